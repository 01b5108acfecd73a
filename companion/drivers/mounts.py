"""Where the sensors sit: distances from unequal places, told as from equal ones."""

import math
from dataclasses import replace

from companion.config.settings import SensorsConfig
from companion.core.errors import ConfigError
from companion.core.messages import BEARING_FRD_RAD, RangeScan

MAX_ASIDE_DEG = 20.0
"""How far a mount may be bent, so that the beam still looks where the manoeuvres need it."""


class Mounts:
    """Of every beam's sensor.

    Raises:
        ConfigError: a sensor looks far aside from where its beam's name says.
    """

    def __init__(self, config: SensorsConfig) -> None:
        for beam, sensor in config.beams.items():
            if sensor.bearing_deg is None:
                continue
            key = f"sensors.ranges.{beam.value}.bearing_deg"
            if beam not in BEARING_FRD_RAD:
                raise ConfigError(f"{key}: {beam.value} has none")
            usual_deg = math.degrees(BEARING_FRD_RAD[beam])
            if abs((sensor.bearing_deg - usual_deg + 180) % 360 - 180) > MAX_ASIDE_DEG:
                raise ConfigError(
                    f"{key} = {sensor.bearing_deg:g}: should be within {MAX_ASIDE_DEG:g} of "
                    f"{usual_deg:g}"
                )
        self._farther_m = {
            beam: farther_m
            for beam in config.beams
            if (farther_m := config.mount_of_m(beam) - config.mount_offset_m)
        }
        """Than `mount_offset_m`, which the estimator takes for all."""

    def level(self, scan: RangeScan) -> RangeScan:
        """The distances from `mount_offset_m` off the centre, whatever the sensor's own offset."""
        moved = {
            beam: replace(reading, distance_m=reading.distance_m + farther_m)
            for beam, farther_m in self._farther_m.items()
            if (reading := scan.readings.get(beam)) and reading.is_distance
        }
        return RangeScan(scan.time_s, {**scan.readings, **moved}) if moved else scan

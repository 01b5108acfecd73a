"""Where the sensors sit: distances from unequal places, told as from equal ones."""

from dataclasses import replace

from companion.config import SensorsConfig
from companion.errors import ConfigError
from companion.messages import Beam, RangeScan

BEARINGS_DEG = {Beam.FRONT: 0.0, Beam.RIGHT: 90.0, Beam.BACK: 180.0, Beam.LEFT: -90.0}
"""Clockwise from ahead, seen from above."""
MOST_ASIDE_DEG = 20.0
"""How far a mount may be bent, so that the beam still looks where the manoeuvres need it."""


class Mounts:
    """Of every beam's sensor.

    Raises:
        ConfigError: a sensor looks far aside from where its beam's name says.
    """

    def __init__(self, config: SensorsConfig) -> None:
        for beam, sensor in config.beams.items():
            usual_deg = BEARINGS_DEG.get(beam)
            if sensor.bearing_deg is None:
                continue
            key = f"sensors.ranges.{beam.value}.bearing_deg"
            if usual_deg is None:
                raise ConfigError(f"{key}: {beam.value} has none")
            if abs((sensor.bearing_deg - usual_deg + 180) % 360 - 180) > MOST_ASIDE_DEG:
                raise ConfigError(
                    f"{key} = {sensor.bearing_deg:g}: should be within {MOST_ASIDE_DEG:g} of "
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

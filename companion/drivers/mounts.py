"""Corrects readings for the sensors' individual mount offsets."""

import math
from dataclasses import replace

from companion.config.settings import SensorsConfig
from companion.core.errors import ConfigError
from companion.core.messages import BEARING_FRD_RAD, RangeScan

MAX_DEVIATION_DEG = 20.0
"""Largest deviation of a mount from its beam's nominal bearing. Chosen: manoeuvres need the beam
there."""


class Mounts:
    """Mounts of all sensors.

    Raises:
        ConfigError: a bearing deviates too far from that of the beam's name.
    """

    def __init__(self, config: SensorsConfig) -> None:
        for beam, sensor in config.beams.items():
            if sensor.bearing_deg is None:
                continue
            key = f"sensors.ranges.{beam.value}.bearing_deg"
            if beam not in BEARING_FRD_RAD:
                raise ConfigError(f"{key}: {beam.value} has no bearing")
            usual_deg = math.degrees(BEARING_FRD_RAD[beam])
            if abs((sensor.bearing_deg - usual_deg + 180) % 360 - 180) > MAX_DEVIATION_DEG:
                raise ConfigError(
                    f"{key} = {sensor.bearing_deg:g}: should be within {MAX_DEVIATION_DEG:g} of "
                    f"{usual_deg:g}"
                )
        self._extra_m = {
            beam: extra_m
            for beam in config.beams
            if (extra_m := config.mount_of_m(beam) - config.mount_offset_m)
        }
        """Mount offset beyond `mount_offset_m`, which the estimator assumes for all sensors, m."""

    def level(self, scan: RangeScan) -> RangeScan:
        """Distances as from sensors that are all `mount_offset_m` off the centre."""
        moved = {
            beam: replace(reading, distance_m=reading.distance_m + extra_m)
            for beam, extra_m in self._extra_m.items()
            if (reading := scan.readings.get(beam)) and reading.is_distance
        }
        return RangeScan(scan.time_s, {**scan.readings, **moved}) if moved else scan

"""Where the sensors sit: distances from unequal places, told as from equal ones."""

from dataclasses import replace

from companion.config import SensorsConfig
from companion.errors import ConfigError
from companion.messages import Beam, RangeScan

BEARINGS_DEG = {Beam.FRONT: 0.0, Beam.RIGHT: 90.0, Beam.BACK: 180.0, Beam.LEFT: -90.0}
"""Clockwise from ahead, seen from above."""


class Mounts:
    """Of every beam's sensor.

    Raises:
        ConfigError: a sensor looks aside from its beam, which the estimator does not know yet.
    """

    def __init__(self, config: SensorsConfig) -> None:
        for beam, sensor in config.beams.items():
            usual_deg = BEARINGS_DEG.get(beam)
            if sensor.bearing_deg is not None and sensor.bearing_deg != usual_deg:
                raise ConfigError(
                    f"sensors.ranges.{beam.value}.bearing_deg = {sensor.bearing_deg:g}: "
                    f"should be {usual_deg:g}, or left out"
                    if usual_deg is not None
                    else f"sensors.ranges.{beam.value}.bearing_deg: {beam.value} has none"
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

"""Estimates the ceiling's height above the take-off point from the up beam."""

import statistics

from companion.core.messages import Beam, RangeScan


class Ceiling:
    """Median of the ceiling heights measured by the up beam."""

    def __init__(self, mount_offset_m: float) -> None:
        self._mount_offset_m = mount_offset_m
        self._heights_m: list[float] = []

    def see(self, scan: RangeScan, drone_height_m: float) -> None:
        reading = scan.readings.get(Beam.UP)
        if reading is not None and reading.is_distance:
            self._heights_m.append(drone_height_m + self._mount_offset_m + reading.distance_m)

    @property
    def height_m(self) -> float | None:
        return statistics.median(self._heights_m) if self._heights_m else None

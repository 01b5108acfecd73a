"""Estimates the ceiling's height above the take-off point from the up beam."""

import math
from bisect import insort

from companion.core.messages import Beam, RangeScan


class Ceiling:
    """Median of the ceiling heights measured by the up beam."""

    def __init__(self, mount_offset_m: float) -> None:
        self._mount_offset_m = mount_offset_m
        self._heights_m: list[float] = []
        """All measured heights, in increasing order."""

    def see(self, scan: RangeScan, drone_height_m: float) -> None:
        reading = scan.readings.get(Beam.UP)
        if reading is not None and reading.is_distance:
            insort(self._heights_m, drone_height_m + self._mount_offset_m + reading.distance_m)

    @property
    def height_m(self) -> float | None:
        """None until the up beam has measured the ceiling."""
        count = len(self._heights_m)
        if not count:
            return None
        return (self._heights_m[(count - 1) // 2] + self._heights_m[count // 2]) / 2

    def above_m(self, drone_height_m: float) -> float:
        """Distance from the sensor of a drone at a height to the ceiling, m; else infinite."""
        if self.height_m is None:
            return math.inf
        return self.height_m - drone_height_m - self._mount_offset_m

"""What hangs lower than a drone may fly, met by the up beam on the way below it.

The beams to the sides see only what stands at their own height. The lintel of a door shows from
below, while the drone passes: from the next layer it would be seen only when it is too late.
"""

import math
from collections import defaultdict

from companion.frames import Vector2
from companion.mapping.occupancy import CELL_M
from companion.messages import Beam, Pose, RangeScan, RangeState

LEAST_READINGS = 2
Cell = tuple[int, int]


class Overhead:
    """By cells of the plan, how high what is above has to be at least."""

    def __init__(self, mount_offset_m: float) -> None:
        self._mount_offset_m = mount_offset_m
        self._heights_m: defaultdict[Cell, list[float]] = defaultdict(list)

    def see(self, scan: RangeScan, pose: Pose) -> None:
        """Take in a sweep; what is too near to be measured may be right above the sensor."""
        reading = scan.readings.get(Beam.UP)
        if reading is None or reading.state not in (RangeState.DISTANCE, RangeState.TOO_NEAR):
            return
        above_m = reading.distance_m if reading.is_distance else 0.0
        cell = math.floor(pose.north_m / CELL_M), math.floor(pose.east_m / CELL_M)
        self._heights_m[cell].append(pose.height_m + self._mount_offset_m + above_m)

    def lower_than(self, height_m: float) -> tuple[Vector2, ...]:
        """Middles of the cells above which something hangs, or may hang, lower than that."""
        return tuple(
            ((row + 0.5) * CELL_M, (column + 0.5) * CELL_M)
            for (row, column), heights_m in self._heights_m.items()
            if sum(m < height_m for m in heights_m) >= LEAST_READINGS
        )

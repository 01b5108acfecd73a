"""What hangs lower than a drone may fly, met by the up beam on the way below it.

The beams to the sides see only what stands at their own height. The lintel of a door shows from
below, while the drone passes: from the next layer it would be seen only when it is too late.
"""

import math
from collections import defaultdict

from companion.core.frames import Vector2
from companion.core.messages import Beam, Pose, RangeScan, RangeState
from companion.mapping.occupancy import CELL_M

MIN_READINGS, MIN_SHARE = 2, 0.25
"""So many readings in a cell, and such a share of all there, have to say so."""
MARGIN_M = 0.1
Cell = tuple[int, int]


class Overhead:
    """What the up beam has met, by cells of the plan."""

    def __init__(self, mount_offset_m: float, near_limit_m: float) -> None:
        """`near_limit_m`: nearer than that the sensor cannot measure."""
        self._mount_offset_m, self._near_limit_m = mount_offset_m, near_limit_m
        self._met_m: defaultdict[Cell, list[tuple[float, float]]] = defaultdict(list)
        """The sensor's height, and what is above it at least."""

    def see(self, scan: RangeScan, pose: Pose) -> None:
        """Take in a sweep; what is too near to be measured may be right above the sensor."""
        reading = scan.readings.get(Beam.UP)
        if reading is None or reading.state not in (RangeState.DISTANCE, RangeState.TOO_NEAR):
            return
        above_m = reading.distance_m if reading.is_distance else 0.0
        cell = math.floor(pose.north_m / CELL_M), math.floor(pose.east_m / CELL_M)
        self._met_m[cell].append((pose.height_m + self._mount_offset_m, above_m))

    def lower_than(self, height_m: float, ceiling_m: float | None) -> tuple[Vector2, ...]:
        """Middles of the cells above which something hangs, or may hang, lower than that.

        Where the ceiling itself is too near to be measured, nothing is told of what hangs there.
        """
        tells_to_m = math.inf if ceiling_m is None else ceiling_m - self._near_limit_m - MARGIN_M
        places = []
        for (row, column), met_m in self._met_m.items():
            above_m_all = [
                at_m + above_m for at_m, above_m in met_m if above_m or at_m < tells_to_m
            ]
            low = sum(m < height_m for m in above_m_all)
            if low >= max(MIN_READINGS, MIN_SHARE * len(above_m_all)):
                places.append(((row + 0.5) * CELL_M, (column + 0.5) * CELL_M))
        return tuple(places)

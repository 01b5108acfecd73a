"""Maps obstacles above the drone that are lower than a planned flight height, by the up beam.

The side beams detect obstacles at the drone's own height only. The up beam detects a door's lintel
while the drone passes below it. In the next layer the side beams would detect it too late.
"""

import math
from array import array
from collections import defaultdict

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import Vector2
from companion.core.messages import Beam, Pose, RangeScan, RangeState
from companion.mapping.occupancy import CELL_M

MIN_READINGS, MIN_SHARE = 2, 0.25
"""Least readings in a cell, and least share of its readings, that are low. Chosen."""
MARGIN_M = 0.1
"""Margin on the height up to which the sensor can measure the ceiling, m. Chosen."""
Cell = tuple[int, int]


class Overhead:
    """Readings of the up beam, by cells of the plan."""

    def __init__(self, mount_offset_m: float, near_limit_m: float) -> None:
        """`near_limit_m`: least distance that the sensor measures."""
        self._mount_offset_m, self._near_limit_m = mount_offset_m, near_limit_m
        self._met_m: defaultdict[Cell, list[tuple[float, float]]] = defaultdict(list)
        """Height of the sensor, and least distance to the obstacle above it."""
        self._readings = array("d")

    @property
    def readings(self) -> Array:
        """The readings of this flight (n, 4), m, for `know`.

        North, east, height of the sensor, and distance to the obstacle above it.
        """
        return np.array(self._readings).reshape(-1, 4)

    def know(self, readings: Array) -> None:
        """Add readings (n, 4) of earlier flights."""
        for north_m, east_m, at_m, above_m in readings.tolist():
            self._met_m[_cell((north_m, east_m))].append((at_m, above_m))

    def see(self, scan: RangeScan, pose: Pose) -> None:
        """Add a reading. TOO_NEAR may be an obstacle directly above the sensor."""
        reading = scan.readings.get(Beam.UP)
        if reading is None or reading.state not in (RangeState.DISTANCE, RangeState.TOO_NEAR):
            return
        above_m = reading.distance_m if reading.is_distance else 0.0
        at_m = pose.height_m + self._mount_offset_m
        self._met_m[_cell(pose.ne_m)].append((at_m, above_m))
        self._readings.extend((*pose.ne_m, at_m, above_m))

    def lower_than(self, height_m: float, ceiling_m: float | None) -> tuple[Vector2, ...]:
        """Middles of the cells whose obstacles above are, or may be, lower than this."""
        return tuple(
            (north_m, east_m)
            for north_m, east_m, low_m in self.heights(ceiling_m).tolist()
            if low_m < height_m
        )

    def heights(self, ceiling_m: float | None) -> Array:
        """(n, 3): middles of cells, and the height of what hangs there, or may hang there, m.

        Where the ceiling itself may be TOO_NEAR, such readings are not used.
        """
        usable_to_m = math.inf if ceiling_m is None else ceiling_m - self._near_limit_m - MARGIN_M
        rows = []
        for (row, column), met_m in self._met_m.items():
            above_m_all = sorted(
                at_m + above_m for at_m, above_m in met_m if above_m or at_m < usable_to_m
            )
            least = math.ceil(max(MIN_READINGS, MIN_SHARE * len(above_m_all)))
            if least <= len(above_m_all):
                rows.append(((row + 0.5) * CELL_M, (column + 0.5) * CELL_M, above_m_all[least - 1]))
        return np.array(rows).reshape(-1, 3)


def _cell(place_ne_m: Vector2) -> Cell:
    return math.floor(place_ne_m[0] / CELL_M), math.floor(place_ne_m[1] / CELL_M)

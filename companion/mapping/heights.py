"""Maps floor and table tops from the heights measured by the down beam.

A reading between floor and flight height belongs to a cell of the plan. Adjacent cells at the same
height form one surface. The sensor aliases below half a metre, so an obstacle close below the
drone reads like a distant one, such as the floor. Therefore tops are mapped only from layers that
are high enough above them.
"""

import math
import statistics
from array import array
from collections import defaultdict
from collections.abc import Mapping

import numpy as np
from scipy.ndimage import label

from companion.core.arrays import Array
from companion.core.frames import Vector2
from companion.core.messages import Beam, Pose, RangeScan, Surface

CELL_M = 0.2
"""Size of a cell, m. Chosen."""
MIN_READINGS = 3
"""Least readings above the floor in a cell of a surface. Chosen."""
SAME_HEIGHT_M = 0.08
"""Cells whose heights differ by less may be one surface, m. Chosen."""
ABOVE_FLOOR_M = 0.15
"""A surface lower than this is the floor, m. Chosen."""
MIN_CELLS = 3
"""Least cells of a surface. Chosen."""
Cell = tuple[int, int]


class Heights:
    """Heights measured by the down beam, by cells."""

    def __init__(self, mount_offset_m: float) -> None:
        self._mount_offset_m = mount_offset_m
        self._readings_m: defaultdict[Cell, list[float]] = defaultdict(list)
        self._readings = array("d")

    @property
    def readings(self) -> Array:
        """The readings of this flight (n, 3), m, for `know`: north, east, and height."""
        return np.array(self._readings).reshape(-1, 3)

    def know(self, readings: Array) -> None:
        """Add readings (n, 3) of other flights."""
        for north_m, east_m, height_m in readings.tolist():
            self._readings_m[_cell((north_m, east_m))].append(height_m)

    def see(self, scan: RangeScan, pose: Pose) -> None:
        """Add a reading taken in level attitude."""
        reading = scan.readings.get(Beam.DOWN)
        if reading is not None and reading.is_distance:
            height_m = pose.height_m - self._mount_offset_m - reading.distance_m
            self._readings_m[_cell(pose.ne_m)].append(height_m)
            self._readings.extend((*pose.ne_m, height_m))

    @property
    def floor_m(self) -> float | None:
        """Median of all readings of the floor; None without readings."""
        every = [m for readings in self._readings_m.values() for m in readings]
        if not every:
            return None
        low = statistics.median(every)
        return statistics.median([m for m in every if m < low + ABOVE_FLOOR_M])

    def is_floor(self) -> dict[Vector2, bool]:
        """True for each measured cell, by its middle, if all its readings are of the floor."""
        floor_m = self.floor_m
        if floor_m is None:
            return {}
        return {
            _middle(cell): all(abs(m - floor_m) < ABOVE_FLOOR_M for m in readings_m)
            for cell, readings_m in self._readings_m.items()
        }

    def tops(self) -> tuple[Surface, ...]:
        """Surfaces above the floor, the largest first."""
        floor_m = self.floor_m
        if floor_m is None:
            return ()
        high = {
            cell: top_m
            for cell, readings in self._readings_m.items()
            if (top_m := _top_m(readings, floor_m)) is not None
        }
        surfaces = [_surface(cells, high) for cells in _clusters(high)]
        return tuple(sorted(surfaces, key=lambda surface: -surface.area_m2))


def _cell(place_ne_m: Vector2) -> Cell:
    return math.floor(place_ne_m[0] / CELL_M), math.floor(place_ne_m[1] / CELL_M)


def _middle(cell: Cell) -> Vector2:
    return (cell[0] + 0.5) * CELL_M, (cell[1] + 0.5) * CELL_M


def _top_m(readings_m: list[float], floor_m: float) -> float | None:
    """Height of a cell's surface; None if too few readings are above the floor."""
    above = [m for m in readings_m if m > floor_m + ABOVE_FLOOR_M]
    return statistics.median(above) if len(above) >= MIN_READINGS else None


def _clusters(high: Mapping[Cell, float]) -> list[list[Cell]]:
    """Clusters of adjacent cells at the same height."""
    clusters: list[list[Cell]] = []
    for level in _levels(sorted(high.values())):
        cells = [cell for cell, m in high.items() if level[0] <= m <= level[1]]
        rows, columns = np.array(cells).T
        grid = np.zeros((np.ptp(rows) + 1, np.ptp(columns) + 1), dtype=bool)
        grid[rows - rows.min(), columns - columns.min()] = True
        numbers, count = label(grid, np.ones((3, 3)))
        for number in range(1, count + 1):
            low = np.array((rows.min(), columns.min()))
            places = np.argwhere(numbers == number) + low
            if len(places) >= MIN_CELLS:
                clusters.append([(int(row), int(column)) for row, column in places])
    return clusters


def _levels(heights_m: list[float]) -> list[tuple[float, float]]:
    """Intervals of heights without gaps."""
    levels: list[tuple[float, float]] = []
    for m in heights_m:
        if levels and m - levels[-1][1] < SAME_HEIGHT_M:
            levels[-1] = (levels[-1][0], m)
        else:
            levels.append((m, m))
    return levels


def _surface(cells: list[Cell], high: Mapping[Cell, float]) -> Surface:
    centre: Vector2 = (
        (statistics.fmean(row for row, _ in cells) + 0.5) * CELL_M,
        (statistics.fmean(column for _, column in cells) + 0.5) * CELL_M,
    )
    height_m = statistics.median(high[cell] for cell in cells)
    return Surface(centre, height_m, len(cells) * CELL_M**2)

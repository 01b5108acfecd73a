"""What a map of cells knows of a building, and where it ends.

Cells go by row, northwards, and column, eastwards, before the map is turned.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import Vector2

Points = NDArray[np.float64]
Cells = NDArray[np.bool_]
Numbers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Raster:
    """Where cells lie."""

    cell_m: float
    origin: tuple[float, float, float]
    """East and north of the picture's lower left corner, metres, and its yaw, radians."""
    first: tuple[int, int] = (0, 0)
    """Column and row of the picture that cell (0, 0) is."""

    def to_plan(self, corners: Points) -> Points:
        """(column, row) of cells' corners to (north, east) in metres."""
        x_m, y_m, yaw_rad = self.origin
        right, up = self.cell_m * (corners + self.first).T
        east = x_m + math.cos(yaw_rad) * right - math.sin(yaw_rad) * up
        north = y_m + math.sin(yaw_rad) * right + math.cos(yaw_rad) * up
        return np.column_stack([north, east])

    def to_cells(self, places: Points) -> Numbers:
        """(row, column) of the cells at places (n, 2), north and east in metres."""
        x_m, y_m, yaw_rad = self.origin
        north, east = places[:, 0] - y_m, places[:, 1] - x_m
        right = math.cos(yaw_rad) * east + math.sin(yaw_rad) * north
        up = math.cos(yaw_rad) * north - math.sin(yaw_rad) * east
        column, row = self.first
        cells = np.floor(np.column_stack([up, right]) / self.cell_m).astype(np.int64)
        numbers: Numbers = cells - np.array([row, column])
        return numbers


@dataclass(frozen=True, slots=True, eq=False)
class KnownArea:
    """Of a world that was made from a map: the rest is unknown, neither free nor wall."""

    raster: Raster
    free: Cells
    occupied: Cells
    border: tuple[tuple[Vector2, Vector2], ...] = ()
    """Where what can be flown in would go on into the unknown, (north, east) in metres. The
    simulated world has a wall there, from floor to ceiling, that no score knows."""
    border_m: float = 0.0
    """Its length, without what of it is inside the walls that it ends at."""
    reached_m2: float = 0.0
    """Of what is known to be free, the part that can be reached from the first start."""
    unknown_share: float = 0.0
    """Of what could be reached from there if all that is unknown were air."""

    @property
    def free_m2(self) -> float:
        return float(np.count_nonzero(self.free)) * self.raster.cell_m**2

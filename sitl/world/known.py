"""Represents the known area of a world that was made from a cell map.

Rows go north and columns east, before the map is rotated.
"""

import math
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2


@dataclass(frozen=True, slots=True)
class Raster:
    """Size, origin and rotation of a cell grid."""

    cell_m: float
    origin: tuple[float, float, float]
    """East and north of the image's lower left corner, m, and its yaw, rad."""
    first: tuple[int, int] = (0, 0)
    """Column and row in the image of cell (0, 0)."""

    def to_plan(self, corners: Array) -> Array:
        """Transform cell corners (column, row) to (north, east), m."""
        x_m, y_m, yaw_rad = self.origin
        right, up = self.cell_m * (corners + self.first).T
        east = x_m + math.cos(yaw_rad) * right - math.sin(yaw_rad) * up
        north = y_m + math.sin(yaw_rad) * right + math.cos(yaw_rad) * up
        return np.column_stack([north, east])

    def to_cells(self, places: Array) -> Indices:
        """(row, column) of the cells at places (n, 2), north and east in m."""
        x_m, y_m, yaw_rad = self.origin
        north, east = places[:, 0] - y_m, places[:, 1] - x_m
        right = math.cos(yaw_rad) * east + math.sin(yaw_rad) * north
        up = math.cos(yaw_rad) * north - math.sin(yaw_rad) * east
        column, row = self.first
        cells = np.floor(np.column_stack([up, right]) / self.cell_m).astype(np.int64)
        numbers: Indices = cells - np.array([row, column])
        return numbers


@dataclass(frozen=True, slots=True, eq=False)
class KnownArea:
    """Known part of a world made from a map. The rest is unknown: neither free nor wall."""

    raster: Raster
    free: Mask
    occupied: Mask
    border: tuple[tuple[Vector2, Vector2], ...] = ()
    """Border where free space continues into the unknown, (north, east) in m.

    The simulated world has a wall there, from floor to ceiling. Scores ignore it.
    """
    border_m: float = 0.0
    """Length of the border outside the walls that it ends at, m."""
    reached_m2: float = 0.0
    """Part of the known free area that is reachable from the first start, m²."""
    unknown_share: float = 0.0
    """Unknown share of the area that would be reachable if unknown cells were free."""

    @property
    def free_m2(self) -> float:
        return float(np.count_nonzero(self.free)) * self.raster.cell_m**2

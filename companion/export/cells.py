"""Rasterizes the map into a 2-D grid of cells: occupied, free or unknown."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing
from scipy.spatial import cKDTree

from companion.core.arrays import Array
from companion.core.messages import FloorPlan
from companion.export.rays import rays

CELL_M = 0.05
"""Edge length of a cell, m. Chosen."""
MARGIN_M = 0.5
"""Unknown margin around everything that was measured, m. Chosen."""
OFF_WALLS, NEAR_M = 5, 0.1
"""An obstacle off all walls needs at least this many hits within this radius, m. Chosen."""
UNKNOWN, FREE, OCCUPIED = 0, 1, 2
"""States of a cell."""


@dataclass(frozen=True, slots=True)
class Cells:
    """A grid of square cells of `CELL_M`; row 0 is the southernmost, column 0 the westernmost."""

    states: NDArray[np.uint8]
    """(rows, columns): UNKNOWN, FREE or OCCUPIED."""
    corner_enu_m: tuple[float, float]
    """Position of the south-western corner of the grid: x east, y north, m."""


def cells(plan: FloorPlan) -> Cells:
    """Rasterize a map.

    Cells that beams or the drone passed through are free. Cells of walls, and of hits off the
    walls with enough neighbours, are occupied. Occupied overrides free.
    """
    seen = rays(plan)
    flown = np.array([(pose.east_m, pose.north_m) for pose in plan.path]).reshape(-1, 2)
    walls = np.array([(wall.start_ne_m, wall.end_ne_m) for wall in plan.walls])
    walls = walls.reshape(-1, 2, 2)[:, :, ::-1]
    everything = np.concatenate([seen.reshape(-1, 2), flown, walls.reshape(-1, 2), [[0.0, 0.0]]])
    corner = np.floor((everything.min(axis=0) - MARGIN_M) / CELL_M) * CELL_M
    columns, rows = np.ceil((everything.max(axis=0) + MARGIN_M - corner) / CELL_M).astype(int)
    states = np.full((rows, columns), UNKNOWN, dtype=np.uint8)

    def mark(points: Array, state: int) -> None:
        column, row = ((points - corner) / CELL_M).astype(int).T
        states[row, column] = state

    mark(_along(seen), FREE)
    mark(flown, FREE)
    between_beams = binary_closing(states == FREE, np.ones((3, 3)))
    states[between_beams] = FREE
    off_walls = np.array([hit.wall is None for hit in plan.hits], dtype=bool)
    mark(_crowded(seen[off_walls, 1]), OCCUPIED)
    mark(_along(walls), OCCUPIED)
    return Cells(states, (float(corner[0]), float(corner[1])))


def _along(segments: Array) -> Array:
    """Points (m, 2) on segments, at most half a cell apart."""
    if not len(segments):
        return np.empty((0, 2))
    lengths_m = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    counts = np.ceil(lengths_m / (CELL_M / 2)).astype(int) + 1
    which = np.repeat(np.arange(len(segments)), counts)
    first = np.repeat(np.cumsum(counts) - counts, counts)
    share = (np.arange(len(which)) - first) / np.maximum(counts - 1, 1)[which]
    start, end = segments[which, 0], segments[which, 1]
    points: Array = start + share[:, None] * (end - start)
    return points


def _crowded(points: Array) -> Array:
    """The points (m, 2) with at least `OFF_WALLS` points, themselves included, within `NEAR_M`."""
    if not len(points):
        return points
    neighbours = cKDTree(points).query_ball_point(points, NEAR_M, return_length=True)
    crowded: Array = points[neighbours >= OFF_WALLS]
    return crowded

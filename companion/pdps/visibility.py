"""What shows from where: lines through the cells, from places to what is unseen."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from companion.mapping.occupancy import CELL_M, Cells, Occupancy
from companion.pdps.frontiers import Indices, grown

SEES_M = 2.4
"""From so far a look shows a surface well."""
MIN_SEES_M = 0.9
"""Nearer than this the sensor cannot measure."""
BEYOND_M, MIN_BEYOND = 0.5, 0.6
"""So far beyond a frontier a look goes on, and of that so much, at least, has to be unknown."""
MEETS_WITHIN_CELLS = 2
VIEW_EVERY_CELLS = 3
Which = NDArray[np.bool_]


def viewpoints(may: Cells) -> Indices:
    """Cells where it may look round, (n, 2), a few decimetres apart."""
    return VIEW_EVERY_CELLS * np.argwhere(may[::VIEW_EVERY_CELLS, ::VIEW_EVERY_CELLS])


def sights(grid: Occupancy, known: Cells, views: Indices, targets: Indices) -> Indices:
    """Pairs (view, target), (n, 2), of places (v, 2) and what is unseen (t, 2); `known`: cells.

    A look from the one shows the other well, or what is behind it, with nothing in between.
    """
    near = cKDTree(views).sparse_distance_matrix(
        cKDTree(targets), SEES_M / CELL_M, output_type="ndarray"
    )
    pairs = np.column_stack([near["i"], near["j"]])
    starts, ends = views[pairs[:, 0]], targets[pairs[:, 1]]
    away_m = np.hypot(*(ends - starts).T) * CELL_M
    is_surface = grown(grid.occupied)[tuple(ends.T)]
    meets = (away_m >= MIN_SEES_M) & _meets(grid, starts, ends)
    shows = np.where(is_surface, meets, _opens(known, starts, ends))
    pairs, starts, ends = pairs[shows], starts[shows], ends[shows]
    clear: Indices = pairs[is_clear(grid, starts, ends, SEES_M)]
    return clear


def is_clear(grid: Occupancy, starts: Indices, ends: Indices, most_m: float) -> Which:
    """(n,): whether nothing stands on the lines, none longer than that, of cells (n, 2).

    Ends may lie beyond the grid, as walls do that have just been set right: nothing is known there.
    """
    steps = np.linspace(0, 1, round(most_m / CELL_M), dtype=np.float32)[:, None]
    rows, columns = (
        np.rint(start + steps * (end - start)).astype(np.int32)
        for start, end in zip(starts.T.astype(np.float32), ends.T.astype(np.float32), strict=True)
    )
    height, width = grid.occupied.shape
    is_inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    hit = is_inside & np.take(grid.occupied, rows * width + columns, mode="clip")
    at, line = np.nonzero(hit)
    end_row, end_column = ends[line].T
    before_end = np.maximum(abs(rows[at, line] - end_row), abs(columns[at, line] - end_column)) > 1
    clear = np.ones(len(ends), dtype=bool)
    clear[line[before_end]] = False
    return clear


def _opens(known: Cells, starts: Indices, ends: Indices) -> Which:
    """(n,): whether the lines from starts to ends (n, 2) go on into the unknown.

    A look that grazes a frontier goes on where most is known, and leaves it where it is.
    """
    is_known = _behind(known, starts, ends, round(BEYOND_M / CELL_M))
    opens: Which = np.mean(~is_known, axis=1) >= MIN_BEYOND
    return opens


def _meets(grid: Occupancy, starts: Indices, ends: Indices) -> Which:
    """(n,): whether the lines from starts to ends (n, 2), which are before a surface, meet it."""
    meets: Which = np.any(_behind(grid.occupied, starts, ends, MEETS_WITHIN_CELLS), axis=1)
    return meets


def _behind(cells: Cells, starts: Indices, ends: Indices, count: int) -> Cells:
    """(n, count): what is set where the lines from starts to ends (n, 2) go on."""
    along = (ends - starts) / np.maximum(np.hypot(*(ends - starts).T), 1.0)[:, None]
    rows, columns = (
        count + np.rint(end[:, None] + np.arange(1, count + 1) * step[:, None]).astype(np.int32)
        for end, step in zip(ends.T, along.T, strict=True)
    )
    behind: Cells = np.pad(cells, count)[rows, columns]
    return behind

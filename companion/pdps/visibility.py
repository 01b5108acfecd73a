"""Computes which unseen cells are visible from which viewpoints, by lines through the grid."""

import numpy as np
from scipy.spatial import cKDTree

from companion.core.arrays import Indices, Mask
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.pdps.frontiers import grown

SEES_M = 2.4
"""Maximum distance from which a beam measures a surface well, m. Chosen."""
MIN_SEES_M = 0.9
"""Minimum distance at which the sensor can measure, m. Chosen."""
BEYOND_M, MIN_BEYOND = 0.5, 0.6
"""A line to a frontier continues beyond it by this length, m; this share of it must be unknown.
Chosen."""
MEETS_WITHIN_CELLS = 2
"""A line to a surface must meet an occupied cell within this many cells behind its end. Chosen."""
VIEW_EVERY_CELLS = 3
"""Spacing of the candidate viewpoints, in cells. Chosen."""


def viewpoints(may: Mask) -> Indices:
    """Candidate viewpoints: every `VIEW_EVERY_CELLS`th cell of `may`, (n, 2)."""
    return VIEW_EVERY_CELLS * np.argwhere(may[::VIEW_EVERY_CELLS, ::VIEW_EVERY_CELLS])


def sights(grid: Occupancy, known: Mask, views: Indices, targets: Indices) -> Indices:
    """Pairs (view, target), (n, 2), of viewpoints (v, 2) and the unseen cells (t, 2) they show.

    A view shows a surface if its line is clear and meets the surface. It shows a frontier if its
    line is clear and continues into unknown space. `known` is a mask of known cells.
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


def is_clear(grid: Occupancy, starts: Indices, ends: Indices, most_m: float) -> Mask:
    """True for each line between cells (n, 2) that crosses no occupied cell, (n,).

    No line may be longer than `most_m`. Ends may lie outside the grid, for example on walls that
    were just corrected. Cells there are unknown.
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


def _opens(known: Mask, starts: Indices, ends: Indices) -> Mask:
    """True for each line from starts to ends (n, 2) that continues into unknown space, (n,).

    A line that grazes a frontier continues through known space, and does not move the frontier.
    """
    is_known = _behind(known, starts, ends, round(BEYOND_M / CELL_M))
    opens: Mask = np.mean(~is_known, axis=1) >= MIN_BEYOND
    return opens


def _meets(grid: Occupancy, starts: Indices, ends: Indices) -> Mask:
    """True for each line to a cell before a surface that meets the surface; (n,)."""
    meets: Mask = np.any(_behind(grid.occupied, starts, ends, MEETS_WITHIN_CELLS), axis=1)
    return meets


def _behind(cells: Mask, starts: Indices, ends: Indices, count: int) -> Mask:
    """Values of the `count` cells behind the ends of the lines from starts (n, 2); (n, count)."""
    along = (ends - starts) / np.maximum(np.hypot(*(ends - starts).T), 1.0)[:, None]
    rows, columns = (
        count + np.rint(end[:, None] + np.arange(1, count + 1) * step[:, None]).astype(np.int32)
        for end, step in zip(ends.T, along.T, strict=True)
    )
    behind: Mask = np.pad(cells, count)[rows, columns]
    return behind

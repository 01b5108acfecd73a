"""What is still unseen.

Two kinds of places are worth a look: frontiers, known free space next to unknown space (Yamauchi
1997), and surfaces that on this side were only met from so far that they cannot be mapped exactly:
a wall is two of them.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.spatial import cKDTree

from companion.core.frames import Vector2
from companion.mapping.occupancy import CELL_M, SIDES, Cells, Occupancy

MIN_FRONTIER_CELLS = 6
"""Six tenths of a metre: no drone fits through less."""
MIN_SURFACE_CELLS, SMALL_SURFACE_CELLS = 8, 4
"""Narrower than the one a surface is looked at only in the end, and than the other not at all."""
BEAM_GAP_CELLS = 2
TRIED_WITHIN_M = 0.25
UNSEEN_WITHIN_M = 1.5
"""What is unseen at a place can be told from what is so near to it."""
TRIES = 3
Indices = NDArray[np.int64]
SQUARE = np.ones((3, 3), dtype=bool)
Places = tuple[Vector2, ...]


def unseen(
    grid: Occupancy, tried: Sequence[Places] = (), least_surface: int = MIN_SURFACE_CELLS
) -> Indices:
    """Cells worth a look, (n, 2); of surfaces, where so many hang together."""
    cells = np.argwhere(frontiers(grid) | vague_surfaces(grid, least_surface))
    return not_tried(grid, cells, tried)


def not_tried(grid: Occupancy, cells: Indices, tried: Sequence[Places]) -> Indices:
    """Those of the cells (n, 2) that were not looked at often enough."""
    if not len(cells):
        return cells
    places = centres(grid, cells)
    times = np.zeros(len(cells), dtype=int)
    for looked_at in tried:
        near_m, _ = cKDTree(np.array(looked_at)).query(places)
        times += near_m < TRIED_WITHIN_M
    return cells[times < TRIES]


def still_unseen(grid: Occupancy, places: Places, least_surface: int = MIN_SURFACE_CELLS) -> Places:
    """Those of the places that are, or have close by, something unseen."""
    if not places:
        return ()
    grid = grid.window(places, UNSEEN_WITHIN_M)
    cells = unseen(grid, least_surface=least_surface)
    if not len(cells):
        return ()
    near_m, _ = cKDTree(centres(grid, cells)).query(np.array(places))
    return tuple(place for place, m in zip(places, near_m, strict=True) if m < 1.5 * CELL_M)


def centres(grid: Occupancy, cells: Indices) -> NDArray[np.float64]:
    """(n, 2), north and east."""
    places = [grid.place((row, column)) for row, column in cells.tolist()]
    return np.array(places).reshape(-1, 2)


def frontiers(grid: Occupancy) -> Cells:
    """The edges that are long enough to be worth a look."""
    return without_specks(edges(grid), MIN_FRONTIER_CELLS)


def edges(grid: Occupancy) -> Cells:
    """Known cells with an unknown neighbour that are not beside something occupied."""
    known = known_cells(grid)
    edge: Cells = known & ~grown(grid.occupied) & _beside(~known)
    return edge


def vague_surfaces(grid: Occupancy, least: int = MIN_SURFACE_CELLS) -> Cells:
    """Cells before a surface that from their side no exact reading has ended in, nor close by.

    They are beside it, and free, or free space is beside them.
    """
    occupied, free = grid.occupied, grid.free
    before = np.zeros_like(occupied)
    for side, (north, east) in enumerate(SIDES):
        vague = _moved(occupied & ~grown(grid.well_seen(side)), north, east)
        before |= vague & (free | _moved(free, -north, -east))
    return without_specks(before & ~occupied, least)


def closed_in(known: Cells) -> Cells:
    """Beside unknown space that known space surrounds."""
    unknown = np.pad(~known, 1, constant_values=True)
    parts, _ = label(unknown)
    return grown((unknown & (parts != parts[0, 0]))[1:-1, 1:-1])


def without_specks(cells: Cells, least: int) -> Cells:
    """Without what hangs together in fewer cells than that."""
    numbers, count = label(cells, SQUARE)
    sizes = np.bincount(numbers.ravel(), minlength=count + 1)
    kept: Cells = cells & (sizes[numbers] >= least)
    return kept


def known_cells(grid: Occupancy) -> Cells:
    """Free and occupied cells, and the gaps between two beams that are narrower than the drone."""
    return grid.occupied | ~grown(~grown(grid.free, BEAM_GAP_CELLS), BEAM_GAP_CELLS)


def _moved(cells: Cells, north: int, east: int) -> Cells:
    """By one cell; what leaves the grid is gone."""
    padded = np.pad(cells, 1)
    rows, columns = cells.shape
    return padded[1 - north : 1 - north + rows, 1 - east : 1 - east + columns]


def grown(cells: Cells, times: int = 1) -> Cells:
    """Every cell within so many of one that is set, diagonals included."""
    for _ in range(times):
        tall = cells.copy()
        tall[1:] |= cells[:-1]
        tall[:-1] |= cells[1:]
        cells = tall.copy()
        cells[:, 1:] |= tall[:, :-1]
        cells[:, :-1] |= tall[:, 1:]
    return cells


def _beside(cells: Cells) -> Cells:
    """Every cell that is set, or has one at its side that is."""
    beside = cells.copy()
    beside[1:] |= cells[:-1]
    beside[:-1] |= cells[1:]
    beside[:, 1:] |= cells[:, :-1]
    beside[:, :-1] |= cells[:, 1:]
    return beside

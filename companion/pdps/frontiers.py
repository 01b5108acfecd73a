"""Finds the cells that are still unseen: frontiers, and surfaces without an exact measurement.

A frontier is known free space next to unknown space (Yamauchi 1997). A surface is one side of an
obstacle; a wall has two. It is unseen if it was measured only from too far away to map it exactly.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import label
from scipy.spatial import cKDTree

from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2
from companion.mapping.occupancy import CELL_M, SIDES, Occupancy

MIN_FRONTIER_CELLS = 6
"""Minimum length of a frontier, in cells: 0.6 m. Chosen: the drone does not fit through less."""
MIN_SURFACE_CELLS, SMALL_SURFACE_CELLS = 8, 4
"""Minimum widths of a surface, in cells: narrower than the first, it is a target only at the end;
narrower than the second, never. Chosen."""
BEAM_GAP_CELLS = 2
"""Gaps between free cells up to twice this width count as known, in cells. Chosen."""
TRIED_WITHIN_M = 0.25
"""A target nearer than this to an earlier target is the same target, m. Chosen."""
UNSEEN_WITHIN_M = 1.5
"""Half width of the map window in which a place is checked again, m. Chosen."""
TRIES = 3
"""Number of looks after which a target is dropped. Chosen."""
SQUARE = np.ones((3, 3), dtype=bool)
"""Neighbourhood of a cell: cells that touch at a corner are connected too."""
Places = tuple[Vector2, ...]


def unseen(
    grid: Occupancy, tried: Sequence[Places] = (), least_surface: int = MIN_SURFACE_CELLS
) -> Indices:
    """Unseen cells that were not tried too often, (n, 2).

    Surfaces count only from `least_surface` connected cells. `tried` has the targets of each look.
    """
    cells = np.argwhere(frontiers(grid) | vague_surfaces(grid, least_surface))
    return not_tried(grid, cells, tried)


def not_tried(grid: Occupancy, cells: Indices, tried: Sequence[Places]) -> Indices:
    """The cells (n, 2) that were the target of fewer than `TRIES` looks."""
    if not len(cells):
        return cells
    places = centres(grid, cells)
    times = np.zeros(len(cells), dtype=int)
    for looked_at in tried:
        near_m, _ = cKDTree(np.array(looked_at)).query(places)
        times += near_m < TRIED_WITHIN_M
    return cells[times < TRIES]


def still_unseen(grid: Occupancy, places: Places, least_surface: int = MIN_SURFACE_CELLS) -> Places:
    """The places that are still unseen, or have an unseen cell next to them."""
    if not places:
        return ()
    grid = grid.window(places, UNSEEN_WITHIN_M)
    cells = unseen(grid, least_surface=least_surface)
    if not len(cells):
        return ()
    near_m, _ = cKDTree(centres(grid, cells)).query(np.array(places))
    return tuple(place for place, m in zip(places, near_m, strict=True) if m < 1.5 * CELL_M)


def centres(grid: Occupancy, cells: Indices) -> Array:
    """Centres of cells (n, 2): north and east, m, (n, 2)."""
    places = [grid.place((row, column)) for row, column in cells.tolist()]
    return np.array(places).reshape(-1, 2)


def frontiers(grid: Occupancy) -> Mask:
    """Edges of known space with at least `MIN_FRONTIER_CELLS` cells."""
    return without_specks(edges(grid), MIN_FRONTIER_CELLS)


def edges(grid: Occupancy) -> Mask:
    """Known cells that have an unknown neighbour, but no occupied one."""
    known = known_cells(grid)
    edge: Mask = known & ~grown(grid.occupied) & _beside(~known)
    return edge


def vague_surfaces(grid: Occupancy, least: int = MIN_SURFACE_CELLS) -> Mask:
    """Cells before a surface that has no exact reading from their side, nor close by.

    Each is next to the surface, and is free or next to a free cell.
    """
    occupied, free = grid.occupied, grid.free
    before = np.zeros_like(occupied)
    for side, (north, east) in enumerate(SIDES):
        vague = _moved(occupied & ~grown(grid.well_seen(side)), north, east)
        before |= vague & (free | _moved(free, -north, -east))
    return without_specks(before & ~occupied, least)


def closed_in(known: Mask) -> Mask:
    """Cells in or next to unknown space that known space surrounds."""
    unknown = np.pad(~known, 1, constant_values=True)
    parts, _ = label(unknown)
    return grown((unknown & (parts != parts[0, 0]))[1:-1, 1:-1])


def without_specks(cells: Mask, least: int) -> Mask:
    """The cells without connected groups of fewer than `least` cells."""
    numbers, count = label(cells, SQUARE)
    sizes = np.bincount(numbers.ravel(), minlength=count + 1)
    kept: Mask = cells & (sizes[numbers] >= least)
    return kept


def known_cells(grid: Occupancy) -> Mask:
    """Free and occupied cells, and gaps between two beams that are narrower than the drone."""
    return grid.occupied | ~grown(~grown(grid.free, BEAM_GAP_CELLS), BEAM_GAP_CELLS)


def _moved(cells: Mask, north: int, east: int) -> Mask:
    """The mask shifted by one cell. Cells that leave the grid are lost."""
    padded = np.pad(cells, 1)
    rows, columns = cells.shape
    return padded[1 - north : 1 - north + rows, 1 - east : 1 - east + columns]


def grown(cells: Mask, times: int = 1) -> Mask:
    """The mask dilated by a number of cells, diagonals included."""
    for _ in range(times):
        tall = cells.copy()
        tall[1:] |= cells[:-1]
        tall[:-1] |= cells[1:]
        cells = tall.copy()
        cells[:, 1:] |= tall[:, :-1]
        cells[:, :-1] |= tall[:, 1:]
    return cells


def _beside(cells: Mask) -> Mask:
    """The mask dilated by one cell, without diagonals."""
    beside = cells.copy()
    beside[1:] |= cells[:-1]
    beside[:-1] |= cells[1:]
    beside[:, 1:] |= cells[:, :-1]
    beside[:, :-1] |= cells[:, 1:]
    return beside

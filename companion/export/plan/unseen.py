"""Finds the borders of an unfinished map: where free space ends and nothing was seen beyond.

beams and path ─► free cells ─► gaps between beams closed, single beams taken away
                                    └─► outline ─► without what runs along walls ─► lines
"""

import numpy as np
from contourpy import contour_generator
from scipy.ndimage import distance_transform_edt, gaussian_filter

from companion.core.arrays import Array, Mask
from companion.core.frames import Vector2
from companion.core.messages import FloorPlan
from companion.export.cells import CELL_M, FREE, OCCUPIED, UNKNOWN, cells

BETWEEN_BEAMS_M = 0.3
"""Free cells this near to each other leave nothing unseen between them, m. Chosen: beams of a drone
that turns at its usual rate are so far apart at 4 m."""
SINGLE_M = 0.2
"""Half the width of space that counts as seen, m. Chosen: beams through a gap are narrower, a
doorway is wider."""
SMOOTH_M = 0.1
"""Sigma of the smoothing of the outline, m. Chosen."""
AT_WALL_M = 0.2
"""An outline this near to a wall or an obstacle runs along it and is no border, m. Chosen: some
cells, and less than half a doorway."""
SHORTEST_M = 0.4
"""Shortest border, m. Chosen: of a doorway of 0.8 m this is left between its jambs."""
EVERY = 4
"""One point of a border in so many is kept. Chosen: they are a cell apart or less."""


def unseen_borders(plan: FloorPlan) -> tuple[tuple[Vector2, ...], ...]:
    """Lines between free and unseen space, each through points north, east, m."""
    grid = cells(plan)
    if not (grid.states == FREE).any():
        return ()
    known = grid.states != UNKNOWN
    closed = _shrunk(_grown(known, BETWEEN_BEAMS_M), BETWEEN_BEAMS_M)
    seen = _grown(_shrunk(closed, SINGLE_M), SINGLE_M)
    smooth = gaussian_filter(seen.astype(float), SMOOTH_M / CELL_M)
    off_wall_m = CELL_M * distance_transform_edt(grid.states != OCCUPIED)
    corner_xy_m = np.array(grid.corner_enu_m) + CELL_M / 2
    borders = []
    for line_found in contour_generator(z=smooth).lines(0.5):
        outline: Array = np.asarray(line_found, dtype=float)
        column, row = outline.round().astype(int).T
        for piece in _runs(outline, off_wall_m[row, column] > AT_WALL_M):
            line_xy_m = corner_xy_m + CELL_M * piece
            if np.hypot(*np.diff(line_xy_m, axis=0).T).sum() > SHORTEST_M:
                thinned = np.concatenate([line_xy_m[:-1:EVERY], line_xy_m[-1:]])
                borders.append(tuple((y, x) for x, y in thinned.tolist()))
    return tuple(borders)


def _grown(mask: Mask, radius_m: float) -> Mask:
    grown: Mask = distance_transform_edt(~mask) <= radius_m / CELL_M
    return grown


def _shrunk(mask: Mask, radius_m: float) -> Mask:
    shrunk: Mask = distance_transform_edt(mask) > radius_m / CELL_M
    return shrunk


def _runs(outline: Array, is_border: Mask) -> list[Array]:
    """Pieces (m, 2) of a closed outline (n, 2) of which all points are border."""
    if is_border.all():
        return [outline]
    first = int(np.argmin(is_border))
    turned, marks = np.roll(outline[:-1], -first, axis=0), np.roll(is_border[:-1], -first)
    starts = np.flatnonzero(np.diff(marks.astype(int))) + 1
    pieces = zip(np.split(turned, starts), np.split(marks, starts), strict=True)
    return [piece for piece, its in pieces if its[0] and len(piece) > 1]

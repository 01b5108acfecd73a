"""From where to tie walls together that face one another, but were never measured from one place.

How far they are apart only odometry tells then, which has wandered by decimetres from one to the
other. From between them, two beams tell it to a few centimetres.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from companion.config import MissionConfig
from companion.mapping.known_walls import KnownWalls
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.pdps.looks import ROOM_TO_LOOK_M, Look, seconds
from companion.pdps.route import Ways
from companion.pdps.sight import Sight
from companion.pdps.unseen import Indices
from companion.pdps.views import Which, is_clear, viewpoints

LOOSE_M = 0.05
"""Sigma of the distance between two walls that is worth a look."""
TIES_FROM_M, TIES_TO_M = 0.9, 4.0
"""From where a beam tells something of a wall that it is square to."""
LEAST_WALL_M, WALL_END_M = 1.0, 0.2
BEFORE_WALL_M = 0.2
"""So far before a wall the map has nothing of it."""
TRIED_WITHIN_M = 2.0
"""From so near another look tells nothing else."""
Array = NDArray[np.float64]


def ties(
    ways: Ways, sight: Sight, plan: MissionConfig, tried: tuple[Look, ...] = ()
) -> tuple[Look, ...]:
    """The look at two walls that tells most for its time, if any is worth it."""
    walls = sight.walls()
    gap_sigmas_m = np.triu(walls.gap_sigmas_m())
    pairs = np.argwhere(gap_sigmas_m > LOOSE_M)
    grid = ways.ground.grid
    room_m = distance_transform_edt(~grid.occupied) * CELL_M
    views = viewpoints(np.isfinite(ways.metres) & (room_m >= ROOM_TO_LOOK_M))
    views = views[_is_new(_places(grid, views), tried)]
    if not len(pairs) or not len(views):
        return ()
    places = _places(grid, views)
    seen = _seen(grid, walls, np.unique(pairs), views, places)
    sees_both = seen[:, pairs[:, 0]] & seen[:, pairs[:, 1]]
    time_s = seconds(views, room_m[tuple(views.T)], ways, sight, plan)
    worth = np.where(sees_both, gap_sigmas_m[tuple(pairs.T)] / time_s[:, None], 0.0)
    view, pair = np.unravel_index(int(worth.argmax()), worth.shape)
    if not worth[view, pair]:
        return ()
    north_m, east_m = places[view].tolist()
    feet = (walls.foot_ne_m(wall, (north_m, east_m)) for wall in pairs[pair].tolist())
    return (Look((north_m, east_m), tuple(feet), is_tie=True),)


def _places(grid: Occupancy, cells: Indices) -> Array:
    """(n, 2), north and east."""
    places = [grid.place((row, column)) for row, column in cells.tolist()]
    return np.array(places).reshape(-1, 2)


def _is_new(places: Array, tried: tuple[Look, ...]) -> Which:
    """(n,): whether nothing was tied from there before."""
    new = np.ones(len(places), dtype=bool)
    for look in tried:
        if look.is_tie:
            new &= np.hypot(*(places - look.from_ne_m).T) > TRIED_WITHIN_M
    return new


def _seen(
    grid: Occupancy, walls: KnownWalls, some: Indices, views: Indices, places: Array
) -> Which:
    """(v, w): which of some walls a beam square to them meets, and nothing before, from views."""
    away_m = walls.distances_m(places)
    along_m = places @ walls.tangents.T
    low_m, high_m = walls.reach_m.T
    asked = np.zeros(len(walls.offsets_m), dtype=bool)
    asked[some] = True
    seen: Which = asked & (walls.lengths_m >= LEAST_WALL_M)
    seen = seen & (away_m >= TIES_FROM_M) & (away_m <= TIES_TO_M)
    seen &= (along_m > low_m + WALL_END_M) & (along_m < high_m - WALL_END_M)
    view, wall = np.nonzero(seen)
    before_m = away_m[view, wall] - BEFORE_WALL_M
    ends = views[view] + np.rint(before_m[:, None] * walls.normals[wall] / CELL_M).astype(int)
    seen[view, wall] = is_clear(grid, views[view], ends, TIES_TO_M)
    return seen

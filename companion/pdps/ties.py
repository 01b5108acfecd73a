"""From where to tie walls together that face one another, but were never measured from one place.

How far they are apart only odometry tells then, which has wandered by decimetres from one to the
other. From between them, two beams tell it to a few centimetres.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.sparse import csr_array

from companion.config import MissionConfig
from companion.mapping.known_walls import KnownWalls
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.pdps.looks import ROOM_TO_LOOK_M, Look, seconds
from companion.pdps.route import Ways
from companion.pdps.sight import Sight
from companion.pdps.unseen import Indices, centres
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
    walls, grid = sight.walls(), ways.ground.grid
    room_m = distance_transform_edt(~grid.occupied) * CELL_M
    views = viewpoints(np.isfinite(ways.metres) & (room_m >= ROOM_TO_LOOK_M))
    places = centres(grid, views)
    is_new = _is_new(places, tried)
    views, places = views[is_new], places[is_new]
    faces = _faces(walls, places)
    gap_sigmas_m = np.triu(walls.gap_sigmas_m())
    pairs = np.argwhere((gap_sigmas_m > LOOSE_M) & _together(faces))
    seen = _seen(grid, walls, faces & np.isin(np.arange(faces.shape[1]), pairs), views, places)
    sees_both = seen[:, pairs[:, 0]] & seen[:, pairs[:, 1]]
    if not sees_both.any():
        return ()
    time_s = seconds(views, room_m[tuple(views.T)], ways, sight, plan)
    worth = np.where(sees_both, gap_sigmas_m[tuple(pairs.T)] / time_s[:, None], 0.0)
    view, pair = np.unravel_index(int(worth.argmax()), worth.shape)
    north_m, east_m = places[view].tolist()
    feet = (walls.foot_ne_m(wall, (north_m, east_m)) for wall in pairs[pair].tolist())
    return (Look((north_m, east_m), tuple(feet), is_tie=True),)


def _is_new(places: Array, tried: tuple[Look, ...]) -> Which:
    """(n,): whether nothing was tied from there before."""
    new = np.ones(len(places), dtype=bool)
    for look in tried:
        if look.is_tie:
            new &= np.hypot(*(places - look.from_ne_m).T) > TRIED_WITHIN_M
    return new


def _faces(walls: KnownWalls, places: Array) -> Which:
    """(p, w): whether a beam from a place, square to a wall, would tell something of it."""
    away_m = walls.distances_m(places)
    along_m = places @ walls.tangents.T
    low_m, high_m = walls.reach_m.T
    faces: Which = (away_m >= TIES_FROM_M) & (away_m <= TIES_TO_M)
    faces &= (along_m > low_m + WALL_END_M) & (along_m < high_m - WALL_END_M)
    return faces & (walls.lengths_m >= LEAST_WALL_M)


def _together(faces: Which) -> Which:
    """(w, w): which walls can be told of from one place. Few of many: a sparse product."""
    told = csr_array(faces.astype(np.int32))
    together: Which = (told.T @ told).toarray() > 0
    return together


def _seen(grid: Occupancy, walls: KnownWalls, faces: Which, views: Indices, places: Array) -> Which:
    """(v, w): those of `faces` from views (v, 2) before which nothing else stands."""
    view, wall = np.nonzero(faces)
    before_m = walls.distances_m(places)[view, wall] - BEFORE_WALL_M
    ends = views[view] + np.rint(before_m[:, None] * walls.normals[wall] / CELL_M).astype(int)
    seen = np.zeros_like(faces)
    seen[view, wall] = is_clear(grid, views[view], ends, TIES_TO_M)
    return seen

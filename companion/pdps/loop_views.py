"""From where to look again at walls that are not known well.

Some face one another, but were never measured from one place. How far they are apart only odometry
tells then, which has wandered by decimetres from one to the other. From between them, two beams
tell it to a few centimetres.

Others are far from the start, as behind a house: odometry alone tells how far. Each way there and
back tells it anew, of all that it leads along.

Both are extras, and lead through no passage in which the drone might touch something because of
what its autopilot's estimate wanders.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label
from scipy.sparse import csr_array

from companion.config.settings import MissionConfig
from companion.core.known_walls import KnownWalls
from companion.mapping.occupancy import CELL_M, Cells, Occupancy
from companion.navigation.grid_planner import ShortestPaths
from companion.navigation.observation import Observation
from companion.pdps.frontiers import Indices, centres
from companion.pdps.viewpoints import ROOM_TO_LOOK_M, Viewpoint, seconds
from companion.pdps.visibility import Which, is_clear, viewpoints
from companion.safety.velocity_guard import BODY_RADIUS_M

LOOSE_M = 0.05
"""Sigma of the distance between two walls that is worth a look."""
TIES_FROM_M, TIES_TO_M = 0.9, 4.0
"""From where a beam tells something of a wall that it is square to."""
MIN_WALL_M, WALL_END_M = 1.0, 0.2
BEFORE_WALL_M = 0.2
"""So far before a wall the map has nothing of it."""
TRIED_WITHIN_M = 2.0
"""From so near another look tells nothing else."""
VAGUE_M, AGAIN_WITHIN_M = 0.06, 6.0
"""Sigma of where a wall is, from the start, that is worth another way there; not if one of the
looks before was so near."""
PASSES_SIGMAS = 5.0
"""Wander that a passage must leave beside the hull: what stands there was measured with one, and
is passed with another, 3.5 sigmas of both."""
ALL_AROUND = np.ones((3, 3), dtype=bool)
Array = NDArray[np.float64]


def ties(
    ways: ShortestPaths,
    observation: Observation,
    plan: MissionConfig,
    tried: tuple[Viewpoint, ...] = (),
) -> tuple[Viewpoint, ...]:
    """The look at two walls that tells most for its time, if any is worth it."""
    walls, grid = observation.walls(), ways.ground.grid
    views, places, time_s = _views(ways, observation, plan, tried, TRIED_WITHIN_M)
    faces = _faces(walls, places)
    gap_sigmas_m = np.triu(walls.gap_sigmas_m())
    pairs = np.argwhere((gap_sigmas_m > LOOSE_M) & _together(faces))
    seen = _seen(grid, walls, faces & np.isin(np.arange(faces.shape[1]), pairs), views, places)
    sees_both = seen[:, pairs[:, 0]] & seen[:, pairs[:, 1]]
    if not sees_both.any():
        return ()
    worth = np.where(sees_both, gap_sigmas_m[tuple(pairs.T)] / time_s[:, None], 0.0)
    view, pair = np.unravel_index(int(worth.argmax()), worth.shape)
    north_m, east_m = places[view].tolist()
    feet = (walls.foot_ne_m(wall, (north_m, east_m)) for wall in pairs[pair].tolist())
    return (Viewpoint((north_m, east_m), tuple(feet), is_tie=True),)


def again(
    ways: ShortestPaths,
    observation: Observation,
    plan: MissionConfig,
    tried: tuple[Viewpoint, ...] = (),
) -> tuple[Viewpoint, ...]:
    """The look that takes least time at the wall that is known worst, if any is worth it.

    None in layers: the next one leads there anew.
    """
    if plan.kind == "layers":
        return ()
    walls, grid = observation.walls(), ways.ground.grid
    views, places, time_s = _views(ways, observation, plan, tried, AGAIN_WITHIN_M)
    faces = _faces(walls, places)
    seen = _seen(grid, walls, faces & (walls.sigmas_m > VAGUE_M), views, places)
    if not seen.any():
        return ()
    wall = int(np.where(seen.any(axis=0), walls.sigmas_m, 0.0).argmax())
    view = np.where(seen[:, wall], time_s, np.inf).argmin()
    north_m, east_m = places[view].tolist()
    foot = walls.foot_ne_m(wall, (north_m, east_m))
    return (Viewpoint((north_m, east_m), (foot,), is_tie=True),)


def _views(
    ways: ShortestPaths,
    observation: Observation,
    plan: MissionConfig,
    tried: tuple[Viewpoint, ...],
    tried_within_m: float,
) -> tuple[Indices, Array, Array]:
    """Cells (v, 2) from where nothing was tied before, their places (v, 2), seconds to each."""
    grid = ways.ground.grid
    room_m = distance_transform_edt(~grid.occupied) * CELL_M
    safe = _safely_reached(room_m, observation, grid)
    views = viewpoints(np.isfinite(ways.metres) & (room_m >= ROOM_TO_LOOK_M) & safe)
    places = centres(grid, views)
    is_new = np.ones(len(places), dtype=bool)
    for look in tried:
        if look.is_tie:
            is_new &= np.hypot(*(places - look.from_ne_m).T) > tried_within_m
    views, places = views[is_new], places[is_new]
    return views, places, seconds(views, room_m[tuple(views.T)], ways, observation, plan)


def _safely_reached(room_m: Array, observation: Observation, grid: Occupancy) -> Cells:
    """From here through nothing narrow; all, where the drone is in something narrow itself."""
    roomy = room_m >= BODY_RADIUS_M + PASSES_SIGMAS * observation.wander_m
    parts, _ = label(roomy, ALL_AROUND)
    here = grid.cell(observation.pose.ne_m)
    part = parts[here] if grid.has(here) else 0
    safe: Cells = parts == part if part else np.ones_like(roomy)
    return safe


def _faces(walls: KnownWalls, places: Array) -> Which:
    """(p, w): whether a beam from a place, square to a wall, would tell something of it."""
    away_m = walls.distances_m(places)
    along_m = places @ walls.tangents.T
    low_m, high_m = walls.reach_m.T
    faces: Which = (away_m >= TIES_FROM_M) & (away_m <= TIES_TO_M)
    faces &= (along_m > low_m + WALL_END_M) & (along_m < high_m - WALL_END_M)
    return faces & (walls.lengths_m >= MIN_WALL_M)


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

"""Selects viewpoints that measure uncertain walls again.

There are two kinds:

- Opposite walls that were never measured from one place. Only odometry measures their distance
  then, and it drifts by decimetres between them. From a place between them, two beams measure the
  distance to a few centimetres.
- Walls far from the start, for example behind a house. Only odometry measures how far. Each flight
  there and back is another measurement of all walls along it.

Both are extras. They use no passage in which the drift of the autopilot's estimate could bring the
drone into contact with an obstacle. What a teammate goes to measure again is left to it.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from scipy.ndimage import distance_transform_edt, label
from scipy.sparse import csr_array

from companion.config.settings import MissionConfig
from companion.core.arrays import Array, Indices, Mask
from companion.core.known_walls import KnownWalls
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.navigation.grid_planner import ShortestPaths
from companion.navigation.observation import Claim, Observation
from companion.pdps.frontiers import centres
from companion.pdps.viewpoints import ROOM_TO_LOOK_M, Viewpoint, seconds
from companion.pdps.visibility import is_clear, viewpoints
from companion.safety.control_laws import BODY_RADIUS_M

LOOSE_M = 0.05
"""Minimum sigma of the distance between two walls that justifies a look, m. Chosen."""
TIES_FROM_M, TIES_TO_M = 0.9, 4.0
"""Distances between which a beam at a right angle to a wall measures it well enough, m. Chosen."""
MIN_WALL_M, WALL_END_M = 1.0, 0.2
"""Minimum length of a wall that is measured again, and margin at either end, m. Chosen."""
BEFORE_WALL_M = 0.2
"""Distance before a wall at which the map has no occupied cells of it, m. Chosen."""
TRIED_WITHIN_M = 2.0
"""Minimum distance of a viewpoint from earlier ones of this kind, m. Chosen: from nearer, the
measurement is the same."""
VAGUE_M, AGAIN_WITHIN_M = 0.06, 6.0
"""Minimum sigma of a wall's position, relative to the start, that justifies another flight there,
and minimum distance from earlier viewpoints of this kind, m. Chosen."""
PASSES_SIGMAS = 5.0
"""Margin beside the hull that a passage must leave, in sigmas of the estimate's drift. The
obstacle was measured with one drift and is passed with another: 3.5 sigmas of both together."""
ALL_AROUND = np.ones((3, 3), dtype=bool)
"""A cell's neighbourhood, with diagonals."""


def ties(
    ways: ShortestPaths,
    observation: Observation,
    plan: MissionConfig,
    tried: tuple[Viewpoint, ...] = (),
) -> tuple[Viewpoint, ...]:
    """The viewpoint between two walls that gains most for its time, or ()."""
    walls, grid = observation.walls(), ways.ground.grid
    views, places, time_s = _views(ways, observation, plan, tried, TRIED_WITHIN_M)
    faces = _faces(walls, places)
    gap_sigmas_m = np.triu(walls.gap_sigmas_m())
    is_loose = (gap_sigmas_m > LOOSE_M) & _together(faces)
    for taken in _taken(walls, observation.claims):
        is_loose &= ~np.outer(taken, taken)
    pairs = np.argwhere(is_loose)
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
    """The viewpoint that shows the most uncertain wall in the least time, or ().

    Always () in the mission "layers": the next layer measures the wall again. Also in the mission
    "exterior" of a team: the drones go round until they meet, which closes the loop.
    """
    if plan.kind == "layers" or (plan.kind == "exterior" and observation.is_in_team):
        return ()
    walls, grid = observation.walls(), ways.ground.grid
    views, places, time_s = _views(ways, observation, plan, tried, AGAIN_WITHIN_M)
    is_vague = walls.sigmas_m > VAGUE_M
    for taken in _taken(walls, observation.claims):
        is_vague &= ~taken
    seen = _seen(grid, walls, _faces(walls, places) & is_vague, views, places)
    if not seen.any():
        return ()
    wall = int(np.where(seen.any(axis=0), walls.sigmas_m, 0.0).argmax())
    view = np.where(seen[:, wall], time_s, np.inf).argmin()
    north_m, east_m = places[view].tolist()
    foot = walls.foot_ne_m(wall, (north_m, east_m))
    return (Viewpoint((north_m, east_m), (foot,), is_tie=True),)


def _taken(walls: KnownWalls, claims: Iterable[Claim]) -> Iterator[Mask]:
    """(w,) of each teammate: the walls that it goes to measure again."""
    for claim in claims:
        if claim.is_extra:
            is_on = walls.has_on_it(np.array(claim.places_ne_m))
            taken: Mask = np.any(is_on, axis=0)
            yield taken


def _views(
    ways: ShortestPaths,
    observation: Observation,
    plan: MissionConfig,
    tried: tuple[Viewpoint, ...],
    tried_within_m: float,
) -> tuple[Indices, Array, Array]:
    """Candidate cells (v, 2), their places (v, 2) in local NED, m, and the time to each, s, (v,).

    Candidates are not within `tried_within_m` of an earlier viewpoint of this kind.
    """
    grid = ways.ground.grid
    room_m = distance_transform_edt(~grid.occupied) * CELL_M
    safe = _safely_reached(ways, room_m, observation)
    views = viewpoints(np.isfinite(ways.metres) & (room_m >= ROOM_TO_LOOK_M) & safe)
    places = centres(grid, views)
    is_new = np.ones(len(places), dtype=bool)
    for look in tried:
        if look.is_tie:
            is_new &= np.hypot(*(places - look.from_ne_m).T) > tried_within_m
    views, places = views[is_new], places[is_new]
    return views, places, seconds(views, room_m[tuple(views.T)], ways, observation, plan)


def _safely_reached(ways: ShortestPaths, room_m: Array, observation: Observation) -> Mask:
    """Cells that the drone reaches without a narrow passage; all, if it is in one itself.

    A cell without a path joins no two parts: unknown space is not free.
    """
    roomy = room_m >= BODY_RADIUS_M + PASSES_SIGMAS * observation.wander_m
    parts, _ = label(roomy & np.isfinite(ways.metres), ALL_AROUND)
    part = parts[ways.ground.start]
    safe: Mask = parts == part if part else np.ones_like(roomy)
    return safe


def _faces(walls: KnownWalls, places: Array) -> Mask:
    """True where a beam from a place at a right angle to a wall can measure that wall; (p, w)."""
    away_m = walls.distances_m(places)
    along_m = places @ walls.tangents.T
    low_m, high_m = walls.reach_m.T
    faces: Mask = (away_m >= TIES_FROM_M) & (away_m <= TIES_TO_M)
    faces &= (along_m > low_m + WALL_END_M) & (along_m < high_m - WALL_END_M)
    return faces & (walls.lengths_m >= MIN_WALL_M)


def _together(faces: Mask) -> Mask:
    """True for pairs of walls that can be measured from one place; (w, w). A sparse product."""
    measurable = csr_array(faces.astype(np.int32))
    together: Mask = (measurable.T @ measurable).toarray() > 0
    return together


def _seen(grid: Occupancy, walls: KnownWalls, faces: Mask, views: Indices, places: Array) -> Mask:
    """The entries of `faces` with a clear line from the view (v, 2) to the wall; (v, w)."""
    view, wall = np.nonzero(faces)
    before_m = walls.distances_m(places)[view, wall] - BEFORE_WALL_M
    ends = views[view] + np.rint(before_m[:, None] * walls.normals[wall] / CELL_M).astype(int)
    seen = np.zeros_like(faces)
    seen[view, wall] = is_clear(grid, views[view], ends, TIES_TO_M)
    return seen

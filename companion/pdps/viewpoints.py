"""Selects the viewpoints from which the drone sees unseen cells.

The next viewpoint is the one that shows most cells for the time to get there. The number of cells
counts by its square root: otherwise small remainders stay behind, and the drone returns for them.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from companion.config.settings import MissionConfig
from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.navigation.grid_planner import ShortestPaths
from companion.navigation.observation import Observation
from companion.pdps.frontiers import (
    MIN_SURFACE_CELLS,
    SMALL_SURFACE_CELLS,
    TRIED_WITHIN_M,
    Places,
    centres,
    closed_in,
    known_cells,
    not_tried,
    unseen,
    vague_surfaces,
)
from companion.pdps.visibility import sights, viewpoints
from companion.safety.velocity_guard import clear_of_all_m

ROOM_TO_LOOK_M = 0.65
"""Minimum clearance of a viewpoint, m, unless only narrow places are left. Chosen."""
AMPLE_ROOM_M = 1.1
"""Clearance above which more has no benefit, m. Chosen."""
CROWDED_S = 6.0
"""Time added per metre of clearance below `AMPLE_ROOM_M`, s/m. Chosen."""
LOOK_S = 4.0
"""Duration of a look, s. Chosen."""
SAME_VIEW_M = 0.35
"""Viewpoints nearer than this show the same, m. Chosen: three cells."""
MIN_SHOWN = 3
"""Minimum number of cells that a viewpoint shows; fewer are left for a later stage. Chosen."""
MAX_LOOKS = 8
"""Maximum number of viewpoints in a tour. Chosen: their order is computed in a few ms."""
MAX_TARGETS = 100
"""Maximum number of targets; of more, every nth is used. Chosen."""
NEAR_SOMETHING_M, OPEN_WITHIN_M = 2.5, 6.0
"""Maximum distance of a target from the nearest obstacle, m: of a full target, and of one in the
open. Chosen."""
OPEN_LOOKS = 6
"""Number of consecutive looks into the open after which it is dropped. Chosen."""
FAR_S, OPEN_WORTH = 20.0, 0.25
"""If all full targets are farther than this time, s, targets in the open count too, with this
weight. Chosen: a hall wider than two ranges is open until its other side is seen."""


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """A viewpoint and its targets, local NED, m."""

    from_ne_m: Vector2
    at_ne_m: Places
    is_open: bool = False
    """True if no obstacle is near the targets."""
    is_tie: bool = False
    """True if it measures known walls again (`loop_views.py`)."""
    least_surface: int = MIN_SURFACE_CELLS
    """Minimum width of its target surfaces, in cells."""

    @property
    def is_extra(self) -> bool:
        """True if the mission is complete without it, so that it may end early."""
        return self.is_tie or self.least_surface < MIN_SURFACE_CELLS


def looks(
    ways: ShortestPaths,
    observation: Observation,
    plan: MissionConfig,
    tried: tuple[Viewpoint, ...] = (),
) -> tuple[Viewpoint, ...]:
    """Viewpoints that together show the unseen cells, best first, at most `MAX_LOOKS`.

    `tried` has all looks so far. A target is dropped after three looks: a step of the pose can
    shift a wall on the map to a place where no beam ever confirms it.

    The order is:

    1. targets with roomy viewpoints,
    2. targets with narrow viewpoints only, as in a corridor,
    3. small targets,
    4. the narrow sides of furniture.

    The open has no end. In a building it is a target only near obstacles, if nothing else is near,
    and only while looks into it show anything. In the mission "exterior" it is none.
    """
    grid = ways.ground.grid
    known = known_cells(grid)
    to_occupied_m = distance_transform_edt(~grid.occupied) * CELL_M
    for each in _stages(grid, known, to_occupied_m, plan, tried):
        stage = each.thinned
        if not len(stage.targets):
            continue
        views = viewpoints(np.isfinite(ways.metres) & (to_occupied_m >= stage.least_room_m))
        time_s = seconds(views, to_occupied_m[tuple(views.T)], ways, observation, plan)
        is_near = time_s <= stage.most_s
        if not is_near.any():
            continue
        views, time_s = views[is_near], time_s[is_near]
        pairs = sights(grid, known, views, stage.targets)
        if found := _best(
            stage, views, time_s, grid, _not_in_vain(stage, views, pairs, tried, grid)
        ):
            return found
    return ()


@dataclass(frozen=True, slots=True)
class _Stage:
    """Targets (t, 2), their weights (t,), and the limits for viewpoints, in one stage."""

    targets: Indices
    worth: Array
    least_shown: float
    least_room_m: float
    most_s: float = math.inf
    least_surface: int = MIN_SURFACE_CELLS
    every: int = 1

    @property
    def thinned(self) -> "_Stage":
        """The stage with every nth target, so that at most `MAX_TARGETS` remain."""
        every = len(self.targets) // (MAX_TARGETS + 1) + 1
        targets, worth = self.targets[::every], self.worth[::every]
        return replace(self, targets=targets, worth=worth, every=every)


def _stages(
    grid: Occupancy,
    known: Mask,
    to_occupied_m: Array,
    plan: MissionConfig,
    tried: Sequence[Viewpoint],
) -> Iterator[_Stage]:
    """Stages in order. A stage is used only if those before give no viewpoint."""
    tight_m = clear_of_all_m(plan)
    looked_at = [look.at_ne_m for look in tried]
    targets = unseen(grid, looked_at)
    off_m = to_occupied_m[tuple(targets.T)]
    is_worthy = (off_m <= NEAR_SOMETHING_M) | closed_in(known)[tuple(targets.T)]
    is_open = ~is_worthy & ((off_m <= OPEN_WITHIN_M) | ~grid.occupied.any())
    is_open &= plan.kind != "exterior" and not _in_vain(tried)
    worth, is_either = np.where(is_worthy, 1.0, OPEN_WORTH), is_worthy | is_open
    worthy = targets[is_worthy], worth[is_worthy]
    either = targets[is_either], worth[is_either]
    if is_open.any():
        yield _Stage(*worthy, MIN_SHOWN, ROOM_TO_LOOK_M, most_s=FAR_S)
    yield _Stage(*either, MIN_SHOWN, ROOM_TO_LOOK_M)
    yield _Stage(*worthy, MIN_SHOWN, tight_m)
    yield _Stage(*worthy, 1, tight_m)
    yield _Stage(*either, OPEN_WORTH, ROOM_TO_LOOK_M)
    small = np.argwhere(vague_surfaces(grid, SMALL_SURFACE_CELLS))
    small = not_tried(grid, small, looked_at)
    any_of = np.ones(len(small))
    yield _Stage(small, any_of, MIN_SHOWN, tight_m, least_surface=SMALL_SURFACE_CELLS)


def _in_vain(tried: Sequence[Viewpoint]) -> bool:
    """True if the last `OPEN_LOOKS` looks all went into the open."""
    last = tried[-OPEN_LOOKS:]
    return len(last) == OPEN_LOOKS and all(look.is_open for look in last)


def seconds(
    views: Indices,
    room_m: Array,
    ways: ShortestPaths,
    observation: Observation,
    plan: MissionConfig,
) -> Array:
    """Time to fly to each viewpoint and look, plus a penalty for small clearance, s, (n,)."""
    time_s = ways.metres[tuple(views.T)] / plan.speed_m_s + LOOK_S
    time_s += turn_rad(observation, views, ways.ground.grid) / math.radians(plan.turn_rate_deg_s)
    crowded: Array = time_s + CROWDED_S * np.maximum(AMPLE_ROOM_M - room_m, 0)
    return crowded


def _best(
    stage: _Stage, views: Indices, time_s: Array, grid: Occupancy, pairs: Indices
) -> tuple[Viewpoint, ...]:
    """The viewpoints among the views (v, 2) that show most targets for their time (v,), s.

    `pairs` (p, 2) list which view shows which target.
    """
    found: list[Viewpoint] = []
    while len(pairs) and len(found) < MAX_LOOKS:
        shows = stage.every * np.bincount(pairs[:, 0], stage.worth[pairs[:, 1]], len(views))
        shows[shows < stage.least_shown] = 0
        best = int(np.argmax(np.sqrt(shows) / time_s))
        if not shows[best]:
            break
        shown = pairs[pairs[:, 0] == best, 1]
        at = tuple(grid.place(_cell(cell)) for cell in stage.targets[shown])
        from_ne_m = grid.place(_cell(views[best]))
        is_open = bool((stage.worth[shown] < 1).all())
        look = Viewpoint(from_ne_m, at, is_open=is_open, least_surface=stage.least_surface)
        found.append(look)
        pairs = pairs[~np.isin(pairs[:, 1], shown)]
    return tuple(found)


def _not_in_vain(
    stage: _Stage, views: Indices, pairs: Indices, tried: Sequence[Viewpoint], grid: Occupancy
) -> Indices:
    """The pairs (p, 2) without those of an earlier look: same viewpoint and same target.

    Behind a corner the unseen edge recedes by one cell per look. Without this condition it stays
    the best target.
    """
    views_ne_m, targets_ne_m = centres(grid, views), centres(grid, stage.targets)
    in_vain = np.zeros(len(pairs), dtype=bool)
    for look in tried:
        is_from = np.hypot(*(views_ne_m - look.from_ne_m).T) < SAME_VIEW_M
        if is_from.any():
            at_m, _ = cKDTree(np.array(look.at_ne_m)).query(targets_ne_m)
            in_vain |= is_from[pairs[:, 0]] & (at_m < TRIED_WITHIN_M)[pairs[:, 1]]
    return pairs[~in_vain]


def turn_rad(observation: Observation, views: Indices, grid: Occupancy) -> Array:
    """Absolute angle from the nose to each view (n, 2), rad, (n,)."""
    here = grid.cell(observation.pose.ne_m)
    north, east = (views - here).T
    off_rad = np.arctan2(east, north) - observation.pose.yaw_rad
    turned_rad: Array = np.abs(np.angle(np.exp(1j * off_rad)))
    return turned_rad


def _cell(row_column: Indices) -> tuple[int, int]:
    return int(row_column[0]), int(row_column[1])

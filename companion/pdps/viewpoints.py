"""From where to look at what is unseen.

The next place to look from is the one that shows most for the time that it takes to get there; but
how much counts by its root only, or what little is left would be left behind, and come back for.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2
from companion.mapping.occupancy import CELL_M, Cells, Occupancy
from companion.navigation.grid_planner import ShortestPaths
from companion.navigation.observation import Observation
from companion.pdps.frontiers import (
    MIN_SURFACE_CELLS,
    SMALL_SURFACE_CELLS,
    TRIED_WITHIN_M,
    Indices,
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
"""A place to look round from has at least so much room, unless only tight ones are left."""
AMPLE_ROOM_M = 1.1
CROWDED_S = 6.0
"""What a metre less room than is ample costs."""
LOOK_S = 4.0
SAME_VIEW_M = 0.35
"""From there the same is seen. Chosen: three cells."""
MIN_SHOWN = 3
"""What shows fewer cells is left for later."""
MAX_LOOKS = 8
"""The order of so many can be found in a few milliseconds."""
MAX_TARGETS = 100
NEAR_SOMETHING_M, OPEN_WITHIN_M = 2.5, 6.0
"""From the nearest thing that stands there to what is worth seeing, and to what may be."""
OPEN_LOOKS = 6
"""After so many into the open, one after the other, nothing more is expected there."""
FAR_S, OPEN_WORTH = 20.0, 0.25
"""When what is worth seeing is farther than this, the open counts, too, by so much: a hall that is
wider than two ranges is open, until its other side has been seen."""
Metres = NDArray[np.float64]
Seconds = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """A place to look from, and at what."""

    from_ne_m: Vector2
    at_ne_m: Places
    is_open: bool = False
    """Nothing stands near to what it is for."""
    is_tie: bool = False
    """It is for how well walls are known, not for what is unseen."""
    least_surface: int = MIN_SURFACE_CELLS
    """What is for it of surfaces is so wide, in cells."""

    @property
    def is_extra(self) -> bool:
        """It is not worth the last of the battery."""
        return self.is_tie or self.least_surface < MIN_SURFACE_CELLS


def looks(
    ways: ShortestPaths,
    observation: Observation,
    plan: MissionConfig,
    tried: tuple[Viewpoint, ...] = (),
) -> tuple[Viewpoint, ...]:
    """Places that together show what is unseen, the one most worth its time first; the first few.

    `tried` are all looks so far; three are enough, also for what was seen: a step of the pose may
    draw a wall beside itself, where nobody will ever see one.

    What only a tight place shows, as a corridor, is left for later, and so is what is small. The
    open outside has no end: in a building it is looked at only when nothing else is near, not far
    from what stands there, and only while that shows anything; round one not at all. In the end
    come the narrow sides of furniture.
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
    """What is looked for, (t, 2), what each of it is worth, (t,), and from where."""

    targets: Indices
    worth: NDArray[np.float64]
    least_shown: float
    least_room_m: float
    most_s: float = math.inf
    least_surface: int = MIN_SURFACE_CELLS
    every: int = 1

    @property
    def thinned(self) -> "_Stage":
        """With one of so many targets that there are few."""
        every = len(self.targets) // (MAX_TARGETS + 1) + 1
        targets, worth = self.targets[::every], self.worth[::every]
        return replace(self, targets=targets, worth=worth, every=every)


def _stages(
    grid: Occupancy,
    known: Cells,
    to_occupied_m: Metres,
    plan: MissionConfig,
    tried: Sequence[Viewpoint],
) -> Iterator[_Stage]:
    """One after the other, each only if there is nothing of those before."""
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
    """The last looks into the open have shown nothing that is worth another."""
    last = tried[-OPEN_LOOKS:]
    return len(last) == OPEN_LOOKS and all(look.is_open for look in last)


def seconds(
    views: Indices,
    room_m: Metres,
    ways: ShortestPaths,
    observation: Observation,
    plan: MissionConfig,
) -> Seconds:
    """(n,): what it takes to go to each place and look, and what is lost where it is crowded."""
    time_s = ways.metres[tuple(views.T)] / plan.speed_m_s + LOOK_S
    time_s += turn_rad(observation, views, ways.ground.grid) / math.radians(plan.turn_rate_deg_s)
    crowded: Seconds = time_s + CROWDED_S * np.maximum(AMPLE_ROOM_M - room_m, 0)
    return crowded


def _best(
    stage: _Stage, views: Indices, time_s: Seconds, grid: Occupancy, pairs: Indices
) -> tuple[Viewpoint, ...]:
    """The places (v, 2) that show most of what is looked for for their time (v,), and so many.

    `pairs` (p, 2) tell which view shows which target.
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
    """The pairs (p, 2) without those of an earlier look: from there, for what is there.

    Round a corner what is unseen falls back along its shadow by a cell a look, and would stay the
    quickest to look at.
    """
    views_ne_m, targets_ne_m = centres(grid, views), centres(grid, stage.targets)
    in_vain = np.zeros(len(pairs), dtype=bool)
    for look in tried:
        is_from = np.hypot(*(views_ne_m - look.from_ne_m).T) < SAME_VIEW_M
        if is_from.any():
            at_m, _ = cKDTree(np.array(look.at_ne_m)).query(targets_ne_m)
            in_vain |= is_from[pairs[:, 0]] & (at_m < TRIED_WITHIN_M)[pairs[:, 1]]
    return pairs[~in_vain]


def turn_rad(observation: Observation, views: Indices, grid: Occupancy) -> NDArray[np.float64]:
    """(n,): how far the nose has to turn towards each place."""
    here = grid.cell(observation.pose.ne_m)
    north, east = (views - here).T
    off_rad = np.arctan2(east, north) - observation.pose.yaw_rad
    turned_rad: NDArray[np.float64] = np.abs(np.angle(np.exp(1j * off_rad)))
    return turned_rad


def _cell(row_column: Indices) -> tuple[int, int]:
    return int(row_column[0]), int(row_column[1])

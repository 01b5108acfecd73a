"""Lets one drone of a team through a doorway at a time.

A drone claims the doorway that it passes, or comes to next. Of two with the same doorway, one that
flies home goes first: it leaves the room to the other. Else the nearer one does, or the one with
the lower number if both are as near. The other waits before the doorway, in the open, where it can
let the first pass. A drone that cannot go on, and looks for another way, has no claim: others may
be in its way because they wait for it. Nor has a drone that lets a teammate pass below: that one
may wait for the same doorway.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from companion.core.frames import Vector2
from companion.mapping.occupancy import CELL_M
from companion.navigation.doorways import AWAY_M, DOORWAY_ROOM_M, SAME_WITHIN_M, Doorway
from companion.navigation.grid_planner import ShortestPaths
from companion.navigation.observation import DoorwayClaim, Observation
from companion.navigation.travel_state import Travel, TravelPhase

CLAIM_WITHIN_M, WAIT_WITHIN_M = 3.0, 2.0
"""A doorway is claimed from the first distance on, and a drone waits from the second on, m. Chosen:
two drones pass each other beside a doorway at 1.2 m; the state is 0.2 s old at 1 m/s."""
AS_NEAR_M = 0.3
"""Two drones are as near to a doorway within this difference, m. Chosen: beyond the errors of the
alignment of their maps."""
INSIDE_M = AWAY_M - AS_NEAR_M
"""A drone that may wait at `AWAY_M` is in the doorway within this distance of its middle, m."""
MAX_WAIT_S = 30.0
"""Longest time of waiting at a doorway, s. Chosen: several times that of a passage. Then the drone
goes on, and keeps off the other as everywhere."""


def claimed(travel: Travel, here: Vector2) -> Doorway | None:
    """The doorway in which the drone is, or to which it comes next; None while it seeks its way."""
    if travel.phase is TravelPhase.SWEEP:
        return None
    for doorway in travel.doorways:
        is_near = math.dist(here, doorway.middle_ne_m) < CLAIM_WITHIN_M
        if is_near and doorway.along_m(here) < AWAY_M:
            return doorway
    return None


def waiting(travel: Travel, observation: Observation) -> Travel:
    """The journey, with the place where the drone waits if the doorway ahead is another's."""
    here, now_s = observation.pose.ne_m, observation.pose.time_s
    doorway = claimed(travel, here) if observation.doorway_claims else None
    is_waiting = travel.waits_at_ne_m is not None
    if doorway is None or not _is_others(doorway, observation, is_waiting=is_waiting):
        if travel.waits_since_s == math.inf:
            return travel
        return replace(travel, waits_at_ne_m=None, waits_since_s=math.inf)
    since_s = min(travel.waits_since_s, now_s)
    may_wait = now_s - since_s <= MAX_WAIT_S
    at_ne_m = (travel.waits_at_ne_m or here) if may_wait else None
    if at_ne_m is None:
        return replace(travel, waits_at_ne_m=None, waits_since_s=since_s)
    return replace(
        travel, waits_at_ne_m=at_ne_m, waits_since_s=since_s, course=None, progress_s=now_s
    )


def out_of_the_way(ways: ShortestPaths, doorways: Sequence[Doorway]) -> Vector2 | None:
    """The nearest place in the open where others can pass all doorways; None if there is none.

    It is the drone's own cell if that is such a place.
    """
    grid = ways.ground.grid
    may_wait = np.isfinite(ways.metres) & (ways.ground.room_m >= DOORWAY_ROOM_M)
    cells = np.argwhere(may_wait)
    for doorway in doorways:
        off = CELL_M * (cells - grid.cell(doorway.middle_ne_m))
        cells = cells[np.hypot(*off.T) > WAIT_WITHIN_M]
    if not len(cells):
        return None
    row, column = cells[ways.metres[tuple(cells.T)].argmin()].tolist()
    return grid.place((row, column))


def _is_others(doorway: Doorway, observation: Observation, *, is_waiting: bool) -> bool:
    """True if the drone is before the doorway, and a teammate goes first."""
    away_m = math.dist(observation.pose.ne_m, doorway.middle_ne_m)
    from_m = INSIDE_M if is_waiting else AWAY_M  # it drifts while it waits
    if not from_m < away_m < WAIT_WITHIN_M:
        return False
    return any(
        _goes_first(claim, away_m, goes_home=observation.goes_home)
        for claim in observation.doorway_claims
        if math.dist(claim.middle_ne_m, doorway.middle_ne_m) < SAME_WITHIN_M
    )


def _goes_first(claim: DoorwayClaim, away_m: float, *, goes_home: bool) -> bool:
    """True if a teammate goes before this drone, which is `away_m` before the doorway.

    A teammate in the doorway goes first in any case.
    """
    if claim.goes_home != goes_home:
        return claim.goes_home or claim.away_m < INSIDE_M
    is_nearer = claim.away_m < away_m - AS_NEAR_M
    return is_nearer or (claim.comes_first and claim.away_m < away_m + AS_NEAR_M)

"""Lets one drone of a team through a doorway at a time.

A drone claims the doorway that it passes, or comes to next. Of two with the same doorway, one that
flies home goes first: it leaves the room to the other. Else the nearer one does, or the one with
the lower number if both are as near. The other waits before the doorway. It goes back first if it
is so near that the one that comes through could not leave the doorway. A drone that cannot go on,
and looks for another way, has no claim: others may be in its way because they wait for it. Nor has
a drone that lets a teammate pass below: that one may wait for the same doorway.
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
from companion.safety.separation import YIELD_M

CLAIM_WITHIN_M, WAIT_WITHIN_M = 3.0, 2.0
"""A doorway is claimed from the first distance on, and a drone waits from the second on, m. Chosen:
two drones pass each other beside a doorway at 1.2 m; the state is 0.2 s old at 1 m/s."""
AS_NEAR_M = 0.3
"""Two drones are as near to a doorway within this difference, m. Chosen: beyond the errors of the
alignment of their maps."""
INSIDE_M = AWAY_M - AS_NEAR_M
"""A drone is in the doorway within this distance of its middle, m. All drones judge by it, those
that come first and those that wait."""
OFF_M = AWAY_M + YIELD_M
"""A drone that waits keeps so far off the doorway's middle, m: then the other one can leave it, and
has room for a turn."""
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
    if doorway is None or not _is_others(doorway, observation):
        if travel.waits_since_s == math.inf:
            return travel
        return replace(travel, waits_at_ne_m=None, waits_since_s=math.inf)
    since_s = min(travel.waits_since_s, now_s)
    may_wait = now_s - since_s <= MAX_WAIT_S
    at_ne_m = (travel.waits_at_ne_m or _off(doorway, here)) if may_wait else None
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


def _off(doorway: Doorway, here: Vector2) -> Vector2:
    """The place where the drone waits: straight back from where it is, if it is too near."""
    away_m = math.dist(here, doorway.middle_ne_m)
    if away_m >= OFF_M:
        return here
    share = OFF_M / away_m
    middle = doorway.middle_ne_m
    return middle[0] + share * (here[0] - middle[0]), middle[1] + share * (here[1] - middle[1])


def _is_others(doorway: Doorway, observation: Observation) -> bool:
    """True if the drone is before the doorway, and a teammate goes first."""
    here = observation.pose.ne_m
    is_before = doorway.along_m(here) < -INSIDE_M
    if not is_before or math.dist(here, doorway.middle_ne_m) >= WAIT_WITHIN_M:
        return False
    return any(
        _goes_first(claim, doorway, here, goes_home=observation.goes_home)
        for claim in observation.doorway_claims
        if math.dist(claim.middle_ne_m, doorway.middle_ne_m) < SAME_WITHIN_M
    )


def _goes_first(claim: DoorwayClaim, doorway: Doorway, here: Vector2, *, goes_home: bool) -> bool:
    """True if a teammate goes before this drone, which is before the doorway.

    One in the doorway goes first in any case, and one that has just left it towards this drone.
    """
    away_m = math.dist(here, doorway.middle_ne_m)
    is_nearer = claim.away_m < away_m - AS_NEAR_M
    is_on_this_side = doorway.along_m(claim.at_ne_m) < 0
    if claim.away_m < INSIDE_M or (is_nearer and is_on_this_side):
        return True
    if claim.goes_home != goes_home:
        return claim.goes_home
    return is_nearer or (claim.comes_first and claim.away_m < away_m + AS_NEAR_M)

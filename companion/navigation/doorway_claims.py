"""Lets one drone of a team through a doorway at a time.

A drone claims the doorway that it passes, or comes to next. Of two with the same doorway, the
nearer one goes first, or the one with the lower number if both are as near. The other waits before
the doorway, in the open, where it can let the first pass.
"""

import math
from dataclasses import replace

from companion.core.frames import Vector2
from companion.navigation.doorways import AWAY_M, SAME_WITHIN_M, Doorway
from companion.navigation.observation import DoorwayClaim, Observation
from companion.navigation.travel_state import Travel

CLAIM_WITHIN_M, WAIT_WITHIN_M = 3.0, 2.0
"""A doorway is claimed from the first distance on, and a drone waits from the second on, m. Chosen:
two drones pass each other beside a doorway at 1.2 m; the state is 0.2 s old at 1 m/s."""
AS_NEAR_M = 0.3
"""Two drones are as near to a doorway within this difference, m. Chosen: beyond the errors of the
alignment of their maps."""
MAX_WAIT_S = 30.0
"""Longest time of waiting at a doorway, s. Chosen: several times that of a passage. Then the drone
goes on, and keeps off the other as everywhere."""


def claimed(travel: Travel, here: Vector2) -> Doorway | None:
    """The doorway in which the drone is, or to which it comes next."""
    for doorway in travel.doorways:
        is_near = math.dist(here, doorway.middle_ne_m) < CLAIM_WITHIN_M
        if is_near and doorway.along_m(here) < AWAY_M:
            return doorway
    return None


def waiting(travel: Travel, observation: Observation) -> Travel:
    """The journey, with the place where the drone waits if the doorway ahead is another's."""
    here, now_s = observation.pose.ne_m, observation.pose.time_s
    doorway = claimed(travel, here) if observation.doorway_claims else None
    if doorway is None or not _is_others(doorway, here, observation.doorway_claims):
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


def _is_others(doorway: Doorway, here: Vector2, claims: tuple[DoorwayClaim, ...]) -> bool:
    """True if the drone is before the doorway, and a teammate goes first."""
    away_m = math.dist(here, doorway.middle_ne_m)
    if not AWAY_M < away_m < WAIT_WITHIN_M:
        return False
    return any(
        claim.away_m < away_m - AS_NEAR_M
        or (claim.comes_first and claim.away_m < away_m + AS_NEAR_M)
        for claim in claims
        if math.dist(claim.middle_ne_m, doorway.middle_ne_m) < SAME_WITHIN_M
    )

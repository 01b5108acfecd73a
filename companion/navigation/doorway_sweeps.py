"""Decides when to sweep the jambs of a doorway on the path, and stores the measured width."""

import math
from dataclasses import replace

from companion.core.frames import Vector2
from companion.navigation import sweep as sweeping
from companion.navigation.doorways import Doorway, remembered
from companion.navigation.grid_planner import CostGrid
from companion.navigation.observation import Observation
from companion.navigation.sweep import Sweep
from companion.navigation.travel_state import Travel, TravelPhase

SWEEP_FROM_M, MIN_SWEEP_FROM_M = 1.6, 1.1
"""A sweep begins between these distances from the doorway's middle, m.

Chosen: nearer than the second, the sensor cannot measure the jambs.
"""
SWEEP_ROOM_M = 0.65
"""Minimum clearance to turn on the spot, m. Chosen: a corridor has it, a doorway does not."""
BACK_OFF_M = ((1.2, 0.0), (1.5, 0.0), (1.2, 0.9), (1.2, -0.9), (0.7, 1.4), (0.7, -1.4))
"""Places to back off to: distance before the doorway and offset to the right, m, in order.

Chosen: the last ones are for a corridor with its doorway at the side.
"""
IN_DOORWAY_M = 0.2
"""Within this distance before its middle, the drone is in the doorway, m. Chosen."""
SWEPT_FOR_S, SWEPT_FOR_M = 30.0, 2.0
"""A sweep stays valid for this time and within this distance of the doorway, s and m.

Chosen: the pose drifts.
"""


def backed_off(
    ground: CostGrid, travel: Travel, observation: Observation, doorways: tuple[Doorway, ...]
) -> Vector2 | None:
    """Place from which the next doorway's jambs can be measured, if the drone is too near.

    Returns None if the drone is not too near, or if no such place has room to turn. Without that
    condition the drone moves to and fro in a corridor that is as narrow as a doorway.
    """
    here = observation.pose.ne_m
    if not doorways:
        return None
    doorway = doorways[0]
    is_too_near = math.dist(here, doorway.middle_ne_m) <= MIN_SWEEP_FROM_M
    is_before = doorway.along_m(here) < -IN_DOORWAY_M
    if not is_too_near or not is_before or _was_swept(travel, doorway):
        return None
    places = (doorway.at_m(-off_m, aside_m) for off_m, aside_m in BACK_OFF_M)
    near = (place for place in places if ground.fits_along(here, place))
    return next((place for place in near if ground.clear_m(place) >= SWEEP_ROOM_M), None)


def _was_swept(travel: Travel, doorway: Doorway) -> bool:
    return any(doorway.is_same(known) and math.isfinite(known.swept_s) for known in travel.known)


def still_swept(travel: Travel, observation: Observation) -> tuple[Doorway, ...]:
    """The known doorways; sweeps that are old or far away are reset."""
    here, now_s = observation.pose.ne_m, observation.pose.time_s

    def is_exact(doorway: Doorway) -> bool:
        is_near = math.dist(here, doorway.middle_ne_m) < SWEPT_FOR_M
        return is_near and now_s - doorway.swept_s < SWEPT_FOR_S

    if not any(math.isfinite(doorway.swept_s) for doorway in travel.known):
        return travel.known  # the common case
    return tuple(
        doorway if is_exact(doorway) else replace(doorway, swept_s=-math.inf)
        for doorway in travel.known
    )


def begin_sweep(travel: Travel, observation: Observation) -> Travel | None:
    """Starts the sweep of a doorway within sweep distance that was not swept yet, or None."""
    here = observation.pose.ne_m
    for doorway in travel.doorways:
        middle = doorway.middle_ne_m
        to_go_m = math.dist(here, middle)
        if not MIN_SWEEP_FROM_M < to_go_m < SWEEP_FROM_M:
            continue
        if _was_swept(travel, doorway):
            continue
        sweep = sweeping.over_jambs(doorway, observation)
        return replace(travel, phase=TravelPhase.SWEEP, sweep=sweep)
    return None


def measured(travel: Travel, sweep: Sweep) -> Travel:
    """Stores the doorway's measured width after a sweep.

    If the doorway is too narrow, the path is deleted and must be planned again.
    """
    if sweep.doorway is None:
        return travel
    looked = sweep.doorway.measured(sweep.met_ne_m)
    *others, doorway = remembered(travel.known, [looked])
    if travel.goes_home or not doorway.looks_narrow:
        return replace(travel, known=(*others, doorway))
    if doorway.is_too_narrow:
        return replace(travel, known=(*others, doorway), way=(), looked_round=True)
    return replace(travel, known=(*others, replace(doorway, swept_s=-math.inf)))  # sweeps again

"""To a place, through known free space.

    FLY ───────────────────────────► ARRIVED
     ▲ │ a doorway is near: pass the front beam over both jambs, so that they are known exactly,
     │ │ from farther off if it is too near to measure them, again if it looks too narrow;
     │ │ no way, or no progress for long: turn all round, once, not in a doorway but before it,
     │ │ where it last had room, if the straight way back there is free
     │ ▼
    SWEEP

    FLY, no way even so ─► GAVE_UP, but home by where it has flown, whatever is drawn there
    FLY, no progress even so: by another way, as if the doorway that it is stuck at were shut; and
    on its way home as if any place that it is stuck at were: a map that is bent leads into walls.
    Where it was stuck on two ways it does not go again, except on its way home

The way is looked at every two seconds, but not in a doorway, by what is known then. It is planned
anew where it is not free any more; after a while in any case, as there may be a shorter one; and if
it leads through a doorway, after each step of the pose, with which the map moved under it. Somebody
who stands in the way is waited for; when he has stood for a while he is on the map, and it leads
round him, or there is none.

Safety: nose first, only through cells that beams have found free; slow where it is narrow; what
appears ahead stops it.
"""

import math
from dataclasses import replace

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2
from companion.core.messages import HOLD, Setpoint
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.navigation import sweep as sweeping
from companion.navigation.doorway_sweeps import (
    SWEEP_FROM_M,
    SWEEP_ROOM_M,
    backed_off,
    begin_sweep,
    measured,
    still_swept,
)
from companion.navigation.doorways import (
    AWAY_M,
    DOORWAY_ROOM_M,
    Doorway,
    find_doorways,
    on_the_way,
    passed_squarely,
    remembered,
    too_narrow,
    with_shut,
)
from companion.navigation.grid_planner import (
    TIGHT_CLEAR_M,
    ShortestPaths,
    find_ground,
    find_ways,
    retraced,
)
from companion.navigation.observation import Observation
from companion.navigation.path_follower import ARRIVED_M, Way, faced, follow, is_blocked, passed
from companion.navigation.travel_state import Travel, TravelPhase
from companion.safety.velocity_guard import clear_of_all_m

CHECK_S, PLAN_S = 2.0, 8.0
DETOUR_M = 3.0
STUCK_S, STUCK_M, TIGHT_STUCK_M = 10.0, 0.25, 0.5
"""So long without getting so far, and it gives up. Between walls that keep it off it moves to and
fro by more than in the open."""
NEARLY_M, NEARLY_S = 0.3, 4.0
"""In a tight place it may not come nearer to its goal: what is too near for the sensors keeps it
off. It does not wait there longer, for what it knows of that drifts."""
AHEAD_M, MAX_SHUT = 0.5, 8
"""So far ahead, and so wide to either side, is what it is stuck at; and so often it goes by another
way."""


def step(
    travel: Travel, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Travel, Setpoint]:
    """One tick: the next state and the velocity to fly."""
    match travel.phase:
        case TravelPhase.FLY:
            return _fly(travel, observation, space, plan)
        case TravelPhase.SWEEP:
            return _sweep(travel, observation, plan)
        case TravelPhase.ARRIVED | TravelPhase.GAVE_UP:
            return travel, HOLD


def _fly(
    travel: Travel, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Travel, Setpoint]:
    now_s = observation.pose.time_s
    is_open = in_the_open(observation, space)
    travel = _progress(travel, observation, STUCK_M if is_open else TIGHT_STUCK_M)
    travel = replace(travel, known=still_swept(travel, observation))
    has_stepped = observation.pose.reset_counter != travel.resets
    if has_stepped or now_s - travel.checked_s > CHECK_S:
        travel = replace(travel, checked_s=now_s, resets=observation.pose.reset_counter)
        if is_open:
            here = observation.pose.ne_m
            travel = replace(travel, roomy_ne_m=here)
        if _must_plan(travel, observation, space, has_stepped=has_stepped):
            travel = _planned(travel, observation, space, plan)
    if travel.phase is not TravelPhase.FLY:
        return travel, HOLD
    if _has_room(observation, space, SWEEP_ROOM_M) and (sweep := begin_sweep(travel, observation)):
        return sweep, HOLD
    if is_blocked(travel.way, observation):
        return replace(travel, course=None), HOLD
    within_m = travel.within_m if is_open and travel.course else ARRIVED_M
    way = passed(travel.way, observation, within_m)
    if not way or (not is_open and _is_as_near_as_it_gets(travel, observation)):
        return replace(travel, phase=TravelPhase.ARRIVED), HOLD
    course = faced(travel.course, way, observation)
    return replace(travel, way=way, course=course), follow(way, course, observation, space, plan)


def _is_as_near_as_it_gets(travel: Travel, observation: Observation) -> bool:
    away_m = math.dist(observation.pose.ne_m, travel.goal_ne_m)
    return away_m < NEARLY_M and _without_progress_s(travel, observation.pose.time_s) >= NEARLY_S


def _must_plan(
    travel: Travel, observation: Observation, space: Occupancy, *, has_stepped: bool
) -> bool:
    """The way may not be the best any more, or none; `has_stepped`: the pose, and so the map."""
    now_s = observation.pose.time_s
    if not travel.way or _is_stuck(travel, now_s):
        return True
    if _passes_doorway(travel, observation):
        return False
    is_due = now_s - travel.planned_s > PLAN_S or (has_stepped and bool(travel.doorways))
    return is_due or not _is_free(travel.way, observation, space)


def _is_free(way: Way, observation: Observation, space: Occupancy) -> bool:
    """Whether there is a way, and it is known to be free, as wide as a doorway."""
    start = observation.pose.ne_m
    for corner in way:
        length_m = math.dist(start, corner)
        bearing_rad = math.atan2(corner[1] - start[1], corner[0] - start[0])
        if space.known_free_m(start, bearing_rad, TIGHT_CLEAR_M, length_m) < length_m:
            return False
        start = corner
    return bool(way)


def in_the_open(observation: Observation, space: Occupancy) -> bool:
    """Not in a doorway, nor where it is as narrow."""
    return _has_room(observation, space, DOORWAY_ROOM_M)


def _has_room(observation: Observation, space: Occupancy, room_m: float) -> bool:
    here = observation.pose.ne_m
    return space.nearest_m(here, room_m) >= room_m


def _passes_doorway(travel: Travel, observation: Observation) -> bool:
    """It is in one: it must not turn there for a way that is better by a decimetre."""
    here = observation.pose.ne_m
    return any(math.dist(here, doorway.middle_ne_m) < AWAY_M for doorway in travel.doorways)


def _progress(travel: Travel, observation: Observation, least_m: float) -> Travel:
    here = observation.pose.ne_m
    if travel.progress_s is not None and math.dist(here, travel.progress_ne_m) < least_m:
        return travel
    return replace(travel, progress_s=observation.pose.time_s, progress_ne_m=here)


def _is_stuck(travel: Travel, now_s: float) -> bool:
    return _without_progress_s(travel, now_s) >= STUCK_S


def _without_progress_s(travel: Travel, now_s: float) -> float:
    return 0.0 if travel.progress_s is None else now_s - travel.progress_s


def _planned(
    travel: Travel, observation: Observation, space: Occupancy, plan: MissionConfig
) -> Travel:
    now_s = observation.pose.time_s
    here = observation.pose.ne_m
    gets_on = not _is_stuck(travel, now_s)
    ways = _ways(travel, here, space, plan)
    if gets_on and ways.reaches(travel.goal_ne_m):
        return along(ways, travel, observation)
    if gets_on and travel.way:  # whoever stands there may go
        return replace(travel, planned_s=now_s)
    roomy = travel.roomy_ne_m or here
    may_look = not travel.looked_round and ways.ground.fits_along(here, roomy)
    travel = replace(travel, looked_round=True)
    if not may_look:
        return _another_way(travel, observation, space, plan)
    sweep = sweeping.all_round(observation, roomy)
    return replace(travel, phase=TravelPhase.SWEEP, sweep=sweep, way=())


def _another_way(
    travel: Travel, observation: Observation, space: Occupancy, plan: MissionConfig
) -> Travel:
    """Through another doorway; home, round any place that it is stuck at."""
    here = observation.pose.ne_m
    doorway = next(
        (d for d in travel.doorways if math.dist(here, d.middle_ne_m) < SWEEP_FROM_M), None
    )
    stuck_at = doorway or _ahead(travel, here)
    if stuck_at is None:
        return replace(travel, phase=TravelPhase.GAVE_UP)
    travel = replace(
        travel,
        shut=(*travel.shut, stuck_at),
        stuck_at=(*travel.stuck_at, stuck_at),
        progress_s=observation.pose.time_s,
    )
    may_go_round = doorway is not None or travel.goes_home
    if may_go_round and (ways := _ways(travel, here, space, plan)).reaches(travel.goal_ne_m):
        return along(ways, travel, observation)
    return replace(travel, phase=TravelPhase.GAVE_UP)


def _ahead(travel: Travel, here: Vector2) -> Doorway | None:
    """What it does not get through, as if it were a doorway; on its way home not for ever."""
    if not travel.way or (travel.goes_home and len(travel.shut) >= MAX_SHUT):
        return None
    north_m, east_m = travel.way[0][0] - here[0], travel.way[0][1] - here[1]
    away_m = max(math.hypot(north_m, east_m), CELL_M)
    unit = north_m / away_m, east_m / away_m
    ahead_m = min(AHEAD_M, away_m)
    middle = here[0] + ahead_m * unit[0], here[1] + ahead_m * unit[1]
    return Doorway(0, middle, unit, AHEAD_M)


def _ways(travel: Travel, here: Vector2, space: Occupancy, plan: MissionConfig) -> ShortestPaths:
    """As far as they are needed: near the way so far, if one there leads to the goal.

    Not through what is too narrow, but for home. If there is none to the start, even after it has
    looked, it goes back the way that it came, and stops before what is really there.
    """
    clear_m = clear_of_all_m(plan)
    narrow = () if travel.goes_home else too_narrow(travel.known, space)
    shut = (*travel.shut, *narrow)
    nearby = space.window((here, *travel.way, travel.goal_ne_m), DETOUR_M)
    ways = find_ways(with_shut(find_ground(nearby, here, clear_m), shut))
    if ways.reaches(travel.goal_ne_m):
        return ways
    ground = find_ground(space, here, clear_m)
    ways = find_ways(with_shut(ground, shut))
    if ways.reaches(travel.goal_ne_m) or not travel.goes_home or not travel.looked_round:
        return ways
    return find_ways(with_shut(retraced(ground), shut))


def along(ways: ShortestPaths, travel: Travel, observation: Observation) -> Travel:
    """On the way to its goal, which the ways found from here reach."""
    here, now_s = observation.pose.ne_m, observation.pose.time_s
    way = ways.to(travel.goal_ne_m)
    found = find_doorways(ways.ground, here, way)
    travel = replace(travel, known=remembered(travel.known, found))
    doorways = on_the_way(travel.known, found, here, way)
    squared = passed_squarely(ways.ground, here, way, doorways)
    back = backed_off(ways.ground, travel, observation, doorways)
    return replace(
        travel,
        way=squared if back is None else (back, *squared),
        doorways=doorways,
        planned_s=now_s,
        checked_s=now_s,
        resets=observation.pose.reset_counter,
    )


def _sweep(
    travel: Travel, observation: Observation, plan: MissionConfig
) -> tuple[Travel, Setpoint]:
    assert travel.sweep is not None
    sweep, setpoint = sweeping.step(travel.sweep, observation, plan)
    travel = replace(travel, sweep=sweep, resets=sweep.resets)
    if not sweep.is_done:
        return travel, setpoint
    flying = replace(
        measured(travel, sweep),
        phase=TravelPhase.FLY,
        sweep=None,
        planned_s=-math.inf,
        checked_s=-math.inf,
        progress_s=observation.pose.time_s,
    )
    return flying, setpoint

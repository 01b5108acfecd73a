"""State machine that flies to a goal through known free space.

    FLY ───────────────────────────► ARRIVED
     ▲ │ a doorway is near: sweep the front beam over both jambs to measure them; from farther
     │ │ away if the drone is too near; again if the doorway measures too narrow
     │ │ no path, or no progress for `STUCK_S`: turn all round, once; not in a doorway, but at the
     │ │ last place with room to turn, if the straight line back to it is free
     │ ▼
    SWEEP ◄── WITHDRAW ◄── FLY, once, if the drift has made the gap to an obstacle doubtful: to the
              nearest place from where the sensors measure all obstacles around

    FLY, still no path ─► GAVE_UP; on the way home the drone retraces its flown cells instead,
    whatever the map contains there
    FLY, still no progress ─► another path, with the doorway where the drone is stuck shut. On the
    way home any place where it is stuck is shut: the walls of a distorted map can block the path.
    A place where the drone was stuck on two journeys stays shut, except on the way home

The path is checked against the current map every `CHECK_S`, but not in a doorway. It is planned
again

- if it is not free any more,
- every `PLAN_S`, because there may be a shorter path,
- if a teammate near the drone has the right of way on it,
- if it passes a doorway, after each step of the pose, because the step moves the map.

The drone waits for a person who stands on the path. After a while the map contains the person; then
the path leads round, or there is none. It waits before a doorway that a teammate passes first
(`doorway_claims.py`).

Safety: the drone flies nose first and only through cells that beams measured as free. It is slow
where clearance is small, and stops before any obstacle that appears ahead.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2, segment_distance_m
from companion.core.messages import HOLD, Setpoint
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.navigation import sweep as sweeping
from companion.navigation.doorway_claims import waiting
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
    CostGrid,
    ShortestPaths,
    find_ground,
    find_ways,
    retraced,
    with_kept_out,
)
from companion.navigation.observation import Observation
from companion.navigation.path_follower import ARRIVED_M, Way, faced, follow, is_blocked, passed
from companion.navigation.travel_state import Travel, TravelPhase
from companion.safety.control_laws import stay
from companion.safety.velocity_guard import clear_of_all_m

CHECK_S, PLAN_S = 2.0, 8.0
"""Periods of checking the path and of planning it again, s. Chosen."""
DETOUR_M = 3.0
"""Margin of the map window round the path, in which a new path is searched first, m. Chosen."""
STUCK_S, STUCK_M, TIGHT_STUCK_M = 10.0, 0.25, 0.5
"""The drone is stuck if in this time, s, it moves less than this distance, m: in the open, and in a
narrow place. Chosen: between two walls the velocity limiter moves the drone to and fro by more
than in the open."""
NEARLY_M, NEARLY_S = 0.3, 4.0
"""In a narrow place the drone has arrived if it stays within this distance of the goal for this
time without progress, m and s. Chosen: obstacles below the sensors' minimum range can keep the
drone off the goal. It does not wait longer, because their stored positions drift."""
MEASURES_FROM_M, ROOM_WORTH = 1.1, 30.0
"""Room from which the sensors measure all obstacles around, m: the minimum of the GP2Y0A710K0F
(datasheet), from the drone's centre. With a smaller minimum, no gap becomes doubtful. Second: cost
of the path that a metre of room is worth, more than in a narrow place (`TIGHT_COST`). Chosen."""
AHEAD_M, MAX_SHUT = 0.5, 8
"""Distance ahead, and half width, of the place that is shut where the drone is stuck, m; and the
maximum number of shut places on the way home. Chosen."""


def step(
    travel: Travel, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Travel, Setpoint]:
    """Runs one tick. Returns the next state and the velocity setpoint."""
    match travel.phase:
        case TravelPhase.FLY:
            travel = waiting(travel, observation)
            if travel.waits_at_ne_m is None:
                return _fly(travel, observation, space, plan)
            return travel, stay(travel.waits_at_ne_m, observation.pose)
        case TravelPhase.SWEEP:
            return _sweep(travel, observation, plan)
        case TravelPhase.WITHDRAW:
            return _withdraw(travel, observation, space, plan)
        case TravelPhase.ARRIVED | TravelPhase.GAVE_UP:
            return travel, HOLD


def _fly(
    travel: Travel, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Travel, Setpoint]:
    now_s = observation.pose.time_s
    if observation.is_gap_doubtful and not travel.withdrew:
        return _to_withdraw(travel, observation, space, plan), HOLD
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
    """True if the path must be planned again. `has_stepped`: the pose, and so the map, stepped."""
    now_s = observation.pose.time_s
    if not travel.way or _is_stuck(travel, now_s):
        return True
    if _passes_doorway(travel, observation):
        return False
    is_due = now_s - travel.planned_s > PLAN_S or (has_stepped and bool(travel.doorways))
    is_due = is_due or _is_kept_out(travel.way, observation)
    return is_due or not _is_free(travel.way, observation, space)


def _is_free(way: Way, observation: Observation, space: Occupancy) -> bool:
    """True if there is a path, and it is known to be free over the width of a doorway."""
    start = observation.pose.ne_m
    for corner in way:
        length_m = math.dist(start, corner)
        bearing_rad = math.atan2(corner[1] - start[1], corner[0] - start[0])
        if space.known_free_m(start, bearing_rad, TIGHT_CLEAR_M, length_m) < length_m:
            return False
        start = corner
    return bool(way)


def _is_kept_out(way: Way, observation: Observation) -> bool:
    """True if the path leads through the place of a teammate with the right of way."""
    corners = (observation.pose.ne_m, *way)
    return any(
        segment_distance_m(each.ne_m, start, end) < each.radius_m
        for each in observation.keep_outs
        for start, end in pairwise(corners)
    )


def in_the_open(observation: Observation, space: Occupancy) -> bool:
    """True if the drone is not in a doorway, nor in a place as narrow as one."""
    return _has_room(observation, space, DOORWAY_ROOM_M)


def _has_room(observation: Observation, space: Occupancy, room_m: float) -> bool:
    here = observation.pose.ne_m
    return space.nearest_m(here, room_m) >= room_m


def _passes_doorway(travel: Travel, observation: Observation) -> bool:
    """True if the drone is in a doorway. There it must not turn for a slightly shorter path."""
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
    ways = _ways(travel, observation, space, plan)
    if gets_on and ways.reaches(travel.goal_ne_m):
        return along(ways, travel, observation)
    if gets_on and travel.way:  # a person who stands there may leave
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
    """Plans a path through another doorway; on the way home, round any place of being stuck."""
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
    if may_go_round and (ways := _ways(travel, observation, space, plan)).reaches(travel.goal_ne_m):
        return along(ways, travel, observation)
    return replace(travel, phase=TravelPhase.GAVE_UP)


def _ahead(travel: Travel, here: Vector2) -> Doorway | None:
    """The place ahead that the drone does not get through, modelled as a doorway.

    Returns None without a path, or after `MAX_SHUT` places on the way home.
    """
    if not travel.way or (travel.goes_home and len(travel.shut) >= MAX_SHUT):
        return None
    north_m, east_m = travel.way[0][0] - here[0], travel.way[0][1] - here[1]
    away_m = max(math.hypot(north_m, east_m), CELL_M)
    unit = north_m / away_m, east_m / away_m
    ahead_m = min(AHEAD_M, away_m)
    middle = here[0] + ahead_m * unit[0], here[1] + ahead_m * unit[1]
    return Doorway(0, middle, unit, AHEAD_M)


def _ways(
    travel: Travel, observation: Observation, space: Occupancy, plan: MissionConfig
) -> ShortestPaths:
    """Shortest paths, within a window round the old path if one reaches the goal there.

    They avoid doorways that are too narrow, except on the way home. If there is no path to the
    start, even after a turn all round, they include all flown cells. The drone still stops before
    real obstacles there.
    """
    here = observation.pose.ne_m
    narrow = () if travel.goes_home else too_narrow(travel.known, space)
    shut = (*travel.shut, *narrow)
    nearby = space.window((here, *travel.way, travel.goal_ne_m), DETOUR_M)
    ways = find_ways(with_shut(_ground(nearby, observation, plan), shut))
    if ways.reaches(travel.goal_ne_m):
        return ways
    ground = _ground(space, observation, plan)
    ways = find_ways(with_shut(ground, shut))
    if ways.reaches(travel.goal_ne_m) or not travel.goes_home or not travel.looked_round:
        return ways
    return find_ways(with_shut(retraced(ground), shut))


def _ground(grid: Occupancy, observation: Observation, plan: MissionConfig) -> CostGrid:
    """The cost grid from the drone's place, with teammates near it."""
    ground = find_ground(grid, observation.pose.ne_m, clear_of_all_m(plan))
    return with_kept_out(ground, observation.keep_outs)


def along(ways: ShortestPaths, travel: Travel, observation: Observation) -> Travel:
    """Sets the path to the goal. The given paths must reach it."""
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


def _to_withdraw(
    travel: Travel, observation: Observation, space: Occupancy, plan: MissionConfig
) -> Travel:
    """Sets the path to the nearest place with room, or to the place with the most room."""
    ways = find_ways(find_ground(space, observation.pose.ne_m, clear_of_all_m(plan)))
    narrow_m = np.maximum(MEASURES_FROM_M - ways.ground.room_m, 0.0)
    best = np.unravel_index((ways.metres + ROOM_WORTH * narrow_m).argmin(), narrow_m.shape)
    place = ways.ground.grid.place((int(best[0]), int(best[1])))
    return replace(
        travel,
        phase=TravelPhase.WITHDRAW,
        withdrew=True,
        way=ways.to(place),
        course=None,
        progress_s=observation.pose.time_s,
        progress_ne_m=observation.pose.ne_m,
    )


def _withdraw(
    travel: Travel, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[Travel, Setpoint]:
    travel = _progress(travel, observation, STUCK_M)
    way = passed(travel.way, observation, ARRIVED_M)
    if not way or _without_progress_s(travel, observation.pose.time_s) >= NEARLY_S:
        sweep = sweeping.all_round(observation, observation.pose.ne_m)
        return replace(travel, phase=TravelPhase.SWEEP, sweep=sweep, way=()), HOLD
    course = faced(travel.course, way, observation)
    return replace(travel, way=way, course=course), follow(way, course, observation, space, plan)


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

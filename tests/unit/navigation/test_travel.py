"""Travel to a goal: arrival, obstacles, detours and giving up."""

import math
from dataclasses import replace
from itertools import pairwise, product

import pytest

from companion.core.frames import moved, segment_distance_m
from companion.core.messages import HOLD
from companion.mapping.rays import Ray
from companion.navigation import travel as travelling
from companion.navigation.path_follower import (
    ARRIVED_M,
)
from companion.navigation.sweep import Sweep
from companion.navigation.travel_state import Travel, TravelPhase, onward, stuck_twice
from companion.pdps.explore import Explore, ExplorePhase, step
from companion.safety.separation import KeepOut
from tests.grids import (
    PLAN,
    Place,
    observation,
    open_ground,
    remaining_headings_rad,
    step_travel,
    stuck_on_a_path,
    walled,
    with_doorway,
)


def test_the_drone_flies_to_its_goal_and_arrives() -> None:
    travel, setpoint = step_travel(Travel((3.0, 0.0)), open_ground())
    assert travel.phase is TravelPhase.FLY
    assert setpoint.forward_m_s > 0.5
    travel, _ = step_travel(Travel((0.05, 0.0)), open_ground())
    assert travel.phase is TravelPhase.ARRIVED
    assert step_travel(travel, open_ground())[0].phase is TravelPhase.ARRIVED


@pytest.mark.parametrize(("half_m", "arrives"), [(0.55, True), (1.5, False)])
def test_travel_arrives_where_near_walls_keep_the_drone_from_its_goal(
    half_m: float, arrives: bool
) -> None:
    grid = open_ground()
    for row, side in product(range(-20, 21), (-1, 1)):
        grid.block((0.1 * row + 0.05, side * half_m), 0.01)
    travel = Travel((0.25, 0.0))
    for second in range(6):
        travel, _ = step_travel(travel, grid, time_s=10.0 + second)
    assert (travel.phase is TravelPhase.ARRIVED) is arrives


@pytest.mark.parametrize(("half_m", "is_stuck"), [(0.55, True), (1.5, False)])
def test_motion_to_and_fro_in_a_narrow_corridor_counts_as_stuck(
    half_m: float, *, is_stuck: bool
) -> None:
    grid = open_ground()
    for row, side in product(range(-6, 7), (-1, 1)):
        grid.block((0.1 * row + 0.05, side * half_m), 0.01)
    travel = Travel((3.0, 0.0))
    for second in range(14):
        seen = observation((0.3 * (second // 3 % 2), 0.0), time_s=10.0 + second)
        travel, _ = travelling.step(travel, seen, grid, PLAN)
    assert travel.looked_round is is_stuck


def test_the_drone_waits_before_a_new_obstacle_on_its_path() -> None:
    travel, _ = step_travel(Travel((3.0, 0.0)), open_ground())
    travel, setpoint = step_travel(travel, open_ground(), ahead_m=0.6, time_s=10.05)
    assert travel.phase is TravelPhase.FLY
    assert setpoint.forward_m_s == 0


def test_the_path_leads_around_an_obstacle_that_stays() -> None:
    travel, _ = step_travel(Travel((3.0, 0.0)), open_ground())
    grid = open_ground()
    grid.block((1.2, 0.0), 0.2)
    travel, _ = step_travel(travel, grid, time_s=13.0)
    assert travel.phase is TravelPhase.FLY
    assert max(abs(east_m) for _, east_m in travel.way) > 0.4


def test_without_a_path_the_drone_turns_all_round_once_and_then_gives_up() -> None:
    grid, time_s = walled(reach_m=2.0), 10.0
    travel, _ = step_travel(Travel((5.0, 0.0)), grid)
    assert travel.phase is TravelPhase.SWEEP
    turned = len(remaining_headings_rad(travel))
    while travel.phase is TravelPhase.SWEEP:
        time_s += 0.05
        seen = observation(yaw_rad=remaining_headings_rad(travel)[0], time_s=time_s)
        travel, _ = travelling.step(travel, seen, grid, PLAN)
    assert turned == 3
    travel, setpoint = step_travel(travel, grid, time_s=time_s + 2)
    assert travel.phase is TravelPhase.GAVE_UP
    assert setpoint == HOLD


@pytest.mark.parametrize(("roomy", "sweeps"), [((0.0, -1.5), True), ((0.0, 2.5), False)])
def test_the_drone_returns_for_a_full_sweep_only_along_a_free_straight_line(
    roomy: Place, *, sweeps: bool
) -> None:
    """The drone is in a doorway. It has flown round a wall 1.5 m east, which is between."""
    grid = walled(reach_m=2.0)
    for jamb_m in (-0.6, 0.6):
        grid.block((jamb_m, 0.0), 0.01)
    for decimetre in range(-20, 21):
        grid.block((0.1 * decimetre + 0.05, 1.5), 0.1)
    travel, setpoint = step_travel(Travel((5.0, 0.0), roomy_ne_m=roomy), grid)
    assert travel.phase is (TravelPhase.SWEEP if sweeps else TravelPhase.GAVE_UP)
    assert sweeps or setpoint == HOLD


@pytest.mark.parametrize("is_doubtful", [True, False])
def test_the_drone_withdraws_once_where_drift_has_made_a_gap_doubtful(*, is_doubtful: bool) -> None:
    """The drone is between two posts, with free space behind it."""
    grid = open_ground()
    for side_m in (-0.6, 0.6):
        grid.block((0.0, side_m), 0.01)
    travel, time_s, here = Travel((3.0, 0.0)), 10.0, (0.0, 0.0)
    phases, least_m = [TravelPhase.FLY], math.inf
    for _ in range(600):
        time_s += 0.05
        yaw_rad = remaining_headings_rad(travel)[0] if travel.sweep else math.pi
        seen = replace(observation(here, yaw_rad, time_s=time_s), is_gap_doubtful=is_doubtful)
        travel, setpoint = travelling.step(travel, seen, grid, PLAN)
        if travel.phase is not phases[-1]:
            phases.append(travel.phase)
        if travel.phase is TravelPhase.WITHDRAW:
            here = moved(here, (0.05 * setpoint.forward_m_s, 0.05 * setpoint.right_m_s), yaw_rad)
        if travel.phase is TravelPhase.SWEEP:
            least_m = min(least_m, grid.nearest_m(here, 2.0))
    if not is_doubtful:
        assert TravelPhase.WITHDRAW not in phases
        return
    assert phases[:4] == [
        TravelPhase.FLY,
        TravelPhase.WITHDRAW,
        TravelPhase.SWEEP,
        TravelPhase.FLY,
    ]
    assert phases.count(TravelPhase.WITHDRAW) == 1
    assert 1.0 < least_m < 1.5


def test_travel_continues_after_a_full_sweep_beside_a_doorway() -> None:
    grid, time_s = with_doorway(0.45), 10.0
    travel, _ = step_travel(Travel((3.0, 0.0)), grid)
    sweep = Sweep((0.0,), (0.0, 0.0), resets=0)
    travel = replace(travel, way=(), phase=TravelPhase.SWEEP, sweep=sweep, looked_round=True)
    for _ in range(2):
        time_s += 0.05
        travel, _ = step_travel(travel, grid, time_s=time_s)
    assert travel.phase is TravelPhase.FLY
    assert travel.way[-1] == (3.0, 0.0)


@pytest.mark.parametrize(("goal", "goes"), [((0.0, 0.0), True), ((-1.0, 0.0), False)])
def test_the_path_home_follows_the_flown_path_although_the_map_blocks_it(
    goal: Place, *, goes: bool
) -> None:
    grid = open_ground()
    for decimetre in range(26):
        grid.add(Ray((0.1 * decimetre, 0.0), 0.0, 0.5, 0.01, is_hit=False, time_s=0.0))
    for row in range(-40, 41):
        grid.block((1.25, 0.1 * row + 0.05), 0.1)
    travel = Travel(goal, looked_round=True)
    travel, _ = travelling.step(travel, observation((2.5, 0.0), yaw_rad=math.pi), grid, PLAN)
    assert (travel.phase is not TravelPhase.GAVE_UP) is goes
    assert bool(travel.way) is goes


@pytest.mark.parametrize("has_another", [True, False])
def test_a_drone_stuck_before_a_doorway_takes_another_if_there_is_one(*, has_another: bool) -> None:
    grid = with_doorway(1.0)
    if has_another:
        for centimetre in range(-39, 40, 3):
            east_m = 2.5 + 0.01 * centimetre
            for _ in range(20):
                grid.add(Ray((0.0, east_m), 0.0, 2.0, 0.01, is_hit=False, time_s=0.0))
    travel, _ = step_travel(Travel((2.0, 0.0)), grid)
    assert max(abs(east_m) for _, east_m in travel.way) < 0.5
    travel = replace(travel, looked_round=True)
    travel, _ = step_travel(travel, grid, time_s=21.0)
    if has_another:
        assert travel.phase is TravelPhase.FLY
        assert max(east_m for _, east_m in travel.way) > 1.5
    else:
        assert travel.phase is TravelPhase.GAVE_UP


@pytest.mark.parametrize(("goal", "goes"), [((0.0, 0.0), True), ((0.0, 0.1), False)])
def test_a_drone_stuck_on_the_path_home_detours_around_an_unmapped_obstacle(
    goal: Place, *, goes: bool
) -> None:
    """The drone is stuck again and again, as at a real wall that a distorted map lacks."""
    travel, grid = Travel(goal, looked_round=True), open_ground()
    for round_ in range(4):
        assert travel.phase is not TravelPhase.GAVE_UP
        seen = observation((2.5, 0.0), yaw_rad=math.pi, time_s=10.0 + 11 * round_)
        travel, _ = travelling.step(travel, seen, grid, PLAN)
        if round_ and not goes:
            break
    assert (travel.phase is not TravelPhase.GAVE_UP) is goes
    assert not goes or max(abs(east_m) for _, east_m in travel.way) > 0.5


def test_exploration_avoids_a_place_where_the_drone_was_stuck_twice() -> None:
    once = stuck_on_a_path(None)
    assert once.phase is TravelPhase.GAVE_UP
    assert stuck_twice(once) == ()
    twice = stuck_on_a_path(once)
    ahead, *_ = stuck_twice(twice)
    assert math.dist(ahead.middle_ne_m, (0.5, 0.0)) < 0.2
    grid = open_ground()
    for travel, leads_ahead in ((once, True), (twice, False)):
        explore = Explore(ExplorePhase.CHOOSE, came=travel)
        while explore.ways is None:
            explore, _ = step(explore, observation(), grid, PLAN)
        straight = max(abs(east_m) for _, east_m in explore.ways.to((1.5, 0.0))) < 0.3
        assert straight is leads_ahead


def test_without_a_path_the_drone_turns_where_it_last_had_room_and_not_in_the_doorway() -> None:
    grid = open_ground()
    for row in range(-40, 41):
        if abs(0.1 * row + 0.05) > 0.45:
            grid.block((0.1 * row + 0.05, 0.05), 0.01)
    roomy, doorway = (0.05, -1.5), (0.05, 0.05)
    going = onward(Travel(doorway, roomy_ne_m=roomy), (9.0, 9.0), ARRIVED_M)
    while going.phase is TravelPhase.FLY:
        going, _ = travelling.step(going, observation(doorway), grid, PLAN)
    assert going.phase is TravelPhase.SWEEP
    _, setpoint = travelling.step(going, observation(doorway), grid, PLAN)
    assert setpoint.right_m_s < -0.1
    assert abs(setpoint.forward_m_s) < 0.05


def test_the_drone_plans_anew_when_a_teammate_with_the_right_of_way_comes_into_its_path() -> None:
    grid = open_ground(reach_m=6.0)
    travel, _ = step_travel(Travel((4.0, 0.0)), grid)
    assert travel.way == ((4.0, 0.0),)
    teammate = KeepOut((2.5, 0.0), 1.2)
    seen = replace(observation(time_s=13.0), keep_outs=(teammate,))
    travel, _ = travelling.step(travel, seen, grid, PLAN)
    legs = pairwise(((0.0, 0.0), *travel.way))
    assert min(segment_distance_m(teammate.ne_m, *leg) for leg in legs) > 1.1
    assert travel.way[-1] == (4.0, 0.0)

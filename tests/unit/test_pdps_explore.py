"""Ways through known space, what is unseen, and the mission that goes and sees it."""

import math
from dataclasses import replace
from itertools import pairwise

import pytest

from companion.config import MissionConfig
from companion.mapping.occupancy import Occupancy, Ray
from companion.messages import Beam, Pose, RangeReading, RangeState
from companion.pdps.explore import Explore, ExplorePhase, step
from companion.pdps.follow import follow, is_blocked
from companion.pdps.gaps import frontiers, next_look
from companion.pdps.room_scan import Sight
from companion.pdps.route import find_ways

PLAN = MissionConfig(kind="building")
CLEAR_M = 0.5
Place = tuple[float, float]


def open_ground(reach_m: float = 4.0, centre: Place = (0.0, 0.0)) -> Occupancy:
    """A disc of free space that nothing bounds."""
    grid = Occupancy()
    look_round(grid, centre, reach_m, hit=False)
    return grid


def look_round(grid: Occupancy, centre: Place, reach_m: float, *, hit: bool) -> None:
    for degree in range(0, 360):
        for _ in range(3):
            grid.add(Ray(centre, math.radians(degree), reach_m, 0.01, hit))


def walled(centre: Place = (0.0, 0.0), reach_m: float = 3.0) -> Occupancy:
    """A round room without a door."""
    grid = Occupancy()
    look_round(grid, centre, reach_m, hit=True)
    return grid


def sight(
    place: Place = (0.0, 0.0), yaw_rad: float = 0.0, ahead_m: float = 5.0, time_s: float = 10.0
) -> Sight:
    ahead = RangeReading(RangeState.DISTANCE, ahead_m, 0.01)
    return Sight(Pose(time_s, *place, -PLAN.height_m, yaw_rad), {Beam.FRONT: ahead}, 0.0)


def length_m(start: Place, way: tuple[Place, ...]) -> float:
    return sum(math.dist(a, b) for a, b in pairwise((start, *way)))


def test_a_way_in_the_open_is_straight() -> None:
    ways = find_ways(open_ground(), (-2.0, 0.0), CLEAR_M)
    assert ways.to((2.0, 1.0)) == ((2.0, 1.0),)


def test_a_way_goes_round_what_is_there_with_room() -> None:
    grid = open_ground()
    grid.block((0.0, 0.0), 0.4)
    way = find_ways(grid, (-2.0, 0.0), CLEAR_M).to((2.0, 0.0))
    assert length_m((-2.0, 0.0), way) > 4.1
    points = [(-2.0, 0.0), *way]
    for a, b in pairwise(points):
        for share in range(11):
            here = tuple(p + share / 10 * (q - p) for p, q in zip(a, b, strict=True))
            assert grid.nearest_m((here[0], here[1]), 2.0) > 0.35


def test_there_is_no_way_through_what_was_never_seen() -> None:
    assert not find_ways(open_ground(), (0.0, 0.0), CLEAR_M).reaches((6.0, 0.0))


def test_in_a_closed_room_nothing_is_unseen() -> None:
    grid = walled()
    assert next_look(grid, find_ways(grid, (0.0, 0.0), CLEAR_M)) is None


def test_a_doorway_is_a_frontier_to_look_through() -> None:
    grid = walled()
    for degree in range(-20, 21):
        for _ in range(20):
            grid.add(Ray((0.0, 0.0), math.radians(degree), 4.0, 0.01, False))
    assert frontiers(grid).any()
    look = next_look(grid, find_ways(grid, (0.0, 0.0), CLEAR_M))
    assert look is not None
    assert abs(math.atan2(look.at_ne_m[1], look.at_ne_m[0])) < math.radians(25)


def test_it_turns_before_it_flies() -> None:
    _, setpoint = follow(((0.0, 3.0),), sight(), open_ground(), PLAN)
    assert setpoint.forward_m_s == 0
    assert setpoint.yaw_rate_rad_s > 0
    _, setpoint = follow(((3.0, 0.0),), sight(), open_ground(), PLAN)
    assert setpoint.forward_m_s > 0.5


def test_it_slows_down_where_it_is_narrow() -> None:
    grid = open_ground()
    _, wide = follow(((3.0, 0.0),), sight(), grid, PLAN)
    grid.block((0.6, 0.5), 0.1)
    _, narrow = follow(((3.0, 0.0),), sight(), grid, PLAN)
    assert narrow.forward_m_s < 0.5 * wide.forward_m_s


def test_it_stops_before_what_stands_in_the_way() -> None:
    way = ((3.0, 0.0),)
    assert is_blocked(way, sight(ahead_m=0.5))
    assert not is_blocked(way, sight(ahead_m=3.0))
    _, setpoint = follow(way, sight(ahead_m=0.5), open_ground(), PLAN)
    assert setpoint.forward_m_s == 0


def test_it_arrives() -> None:
    way, _ = follow(((0.05, 0.0),), sight(), open_ground(), PLAN)
    assert way == ()


# Transitions


def test_look_turns_all_round_then_goes_to_what_is_unseen() -> None:
    explore, grid, yaw_rad = Explore(), open_ground(), 0.0
    while explore.phase is ExplorePhase.LOOK:
        explore, setpoint = step(explore, sight(yaw_rad=yaw_rad), grid, PLAN)
        yaw_rad += 0.1
        assert setpoint.forward_m_s == pytest.approx(0, abs=1e-9)
    assert explore.phase is ExplorePhase.GO
    assert yaw_rad > math.tau


def test_look_ends_the_mission_when_nothing_is_unseen() -> None:
    explore, _ = step(Explore(to_turn_rad=-0.1), sight(), walled(), PLAN)
    assert explore.phase is ExplorePhase.DONE


def going(grid: Occupancy) -> Explore:
    explore, _ = step(Explore(to_turn_rad=-0.1), sight(), grid, PLAN)
    assert explore.phase is ExplorePhase.GO
    return explore


def test_go_looks_round_on_arrival() -> None:
    explore = going(open_ground())
    there = sight(explore.way[-1])
    for _ in range(3):
        explore, _ = step(explore, there, open_ground(), PLAN)
    assert explore.phase is ExplorePhase.LOOK


def test_go_waits_for_who_is_in_the_way_then_takes_another() -> None:
    grid = open_ground()
    explore = going(grid)
    north, east = explore.way[0]
    bearing_rad = math.atan2(east, north)
    blocked = sight(yaw_rad=bearing_rad, ahead_m=0.4)
    explore, setpoint = step(explore, blocked, grid, PLAN)
    assert setpoint.forward_m_s == 0
    later = replace(blocked, pose=replace(blocked.pose, time_s=blocked.pose.time_s + 5))
    another, _ = step(explore, later, grid, PLAN)
    assert another.goal_ne_m != explore.goal_ne_m


def test_go_chooses_again_when_the_goal_was_seen_on_the_way() -> None:
    explore = going(open_ground())
    grid = walled(reach_m=6.0)
    later = replace(sight(), pose=replace(sight().pose, time_s=20.0))
    explore, _ = step(explore, later, grid, PLAN)
    assert explore.phase is ExplorePhase.DONE


def test_done_stays_done() -> None:
    explore, setpoint = step(Explore(ExplorePhase.DONE), sight(), walled(), PLAN)
    assert explore.phase is ExplorePhase.DONE
    assert setpoint.forward_m_s == setpoint.yaw_rate_rad_s == 0

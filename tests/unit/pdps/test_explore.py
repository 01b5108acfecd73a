"""Tests path planning, unseen cells, viewpoints, journeys and the exploration."""

import math
from dataclasses import replace
from itertools import pairwise, permutations, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2
from companion.core.messages import HOLD, Beam, Pose, RangeReading, RangeState, Setpoint
from companion.mapping.occupancy import Occupancy, Ray
from companion.navigation import sweep as sweeping
from companion.navigation import travel as travelling
from companion.navigation.doorways import Doorway
from companion.navigation.grid_planner import ShortestPaths, find_ground, find_ways
from companion.navigation.observation import Observation
from companion.navigation.path_follower import (
    ARRIVED_M,
    Course,
    Way,
    faced,
    follow,
    is_blocked,
    passed,
)
from companion.navigation.sweep import Sweep, over_jambs
from companion.navigation.travel_state import Travel, TravelPhase, onward, stuck_twice
from companion.pdps import layers as layering
from companion.pdps.explore import Explore, ExplorePhase, step
from companion.pdps.frontiers import TRIES, frontiers, known_cells, vague_surfaces
from companion.pdps.layers import Layers, LayersPhase
from companion.pdps.tour import first_of_tour, shortest_first
from companion.pdps.viewpoints import MIN_SHOWN, OPEN_LOOKS, Viewpoint, looks
from companion.pdps.visibility import sights
from companion.safety.seen_free import Lane

PLAN, OUTSIDE = MissionConfig(kind="building"), MissionConfig(kind="exterior")
CLEAR_M = 0.5
NORTH = Course(0.0)
Place = tuple[float, float]


def ways_from(grid: Occupancy, place_ne_m: Vector2) -> ShortestPaths:
    return find_ways(find_ground(grid, place_ne_m, CLEAR_M))


def open_ground(reach_m: float = 4.0, centre: Place = (0.0, 0.0)) -> Occupancy:
    """A disc of free space without walls."""
    grid = Occupancy()
    look_round(grid, centre, reach_m, hit=False)
    return grid


def look_round(grid: Occupancy, centre: Place, reach_m: float, *, hit: bool) -> None:
    for degree in range(0, 360):
        for _ in range(3):
            grid.add(Ray(centre, math.radians(degree), reach_m, 0.01, hit, 0.0))


def walled(centre: Place = (0.0, 0.0), reach_m: float = 3.0) -> Occupancy:
    """A round room without a door."""
    grid = Occupancy()
    look_round(grid, centre, reach_m, hit=True)
    return grid


def observation(
    place: Place = (0.0, 0.0), yaw_rad: float = 0.0, ahead_m: float = 5.0, time_s: float = 10.0
) -> Observation:
    ahead = RangeReading(RangeState.DISTANCE, ahead_m, 0.01)
    return Observation(Pose(time_s, *place, -PLAN.height_m, yaw_rad), {Beam.FRONT: ahead}, 0.0)


def length_m(start: Place, way: tuple[Place, ...]) -> float:
    return sum(math.dist(a, b) for a, b in pairwise((start, *way)))


def test_a_way_in_the_open_is_straight() -> None:
    ways = ways_from(open_ground(), (-2.0, 0.0))
    assert ways.to((2.0, 1.0)) == ((2.0, 1.0),)


def test_a_way_goes_round_what_is_there_with_room() -> None:
    grid = open_ground()
    grid.block((0.0, 0.0), 0.4)
    way = ways_from(grid, (-2.0, 0.0)).to((2.0, 0.0))
    assert length_m((-2.0, 0.0), way) > 4.1
    points = [(-2.0, 0.0), *way]
    for a, b in pairwise(points):
        for share in range(11):
            here = tuple(p + share / 10 * (q - p) for p, q in zip(a, b, strict=True))
            assert grid.nearest_m((here[0], here[1]), 2.0) > 0.35


def test_there_is_no_way_through_what_was_never_seen() -> None:
    assert not ways_from(open_ground(), (0.0, 0.0)).reaches((6.0, 0.0))


def test_a_doorway_is_passed_in_the_middle_and_a_narrower_one_not() -> None:
    for width_m, passes in ((1.4, True), (0.9, True), (0.6, False)):
        grid = open_ground()
        for row in range(-40, 41):
            if abs(0.1 * row + 0.05) > width_m / 2:
                grid.block((0.1 * row + 0.05, 0.05), 0.01)
        assert ways_from(grid, (0.5, -2.0)).reaches((0.5, 2.0)) is passes


@pytest.mark.parametrize(("width_m", "least_m", "most_m"), [(0.9, 0.5, 1.2), (1.3, 5.0, 6.0)])
def test_it_does_not_go_far_into_what_is_narrower_than_its_clearance_nor_step_by_step(
    width_m: float, least_m: float, most_m: float
) -> None:
    grid = open_ground(reach_m=7.0)
    for row, column in product(range(-70, 71), range(0, 71)):
        if abs(0.1 * row + 0.05) > width_m / 2 and (column == 0 or abs(row) < 9):
            grid.block((0.1 * row + 0.05, 0.1 * column + 0.05), 0.01)
    here = (0.05, -1.0)
    while ways_from(grid, here).reaches(further := (here[0], here[1] + 0.1)) and further[1] < 6:
        here = further
    assert least_m < here[1] < most_m


@pytest.mark.parametrize(
    ("width_m", "came_through", "passes"),
    [(0.8, True, True), (0.8, False, False), (0.0, True, False)],
)
def test_where_it_has_come_through_it_may_go_back_unless_that_was_closed(
    width_m: float, came_through: bool, passes: bool
) -> None:
    grid = open_ground()
    for decimetre in range(-10, 11) if came_through else ():
        grid.add(Ray((0.05, 0.1 * decimetre), 0.0, 0.5, 0.01, is_hit=False, time_s=0.0))
    for row in range(-40, 41):
        if abs(0.1 * row + 0.05) > width_m / 2:
            grid.block((0.1 * row + 0.05, 0.05), 0.01)
    assert ways_from(grid, (0.5, -2.0)).reaches((0.5, 2.0)) is passes


def test_in_a_closed_room_whose_walls_were_seen_well_nothing_is_unseen() -> None:
    grid = walled(reach_m=2.0)
    assert not looks(ways_from(grid, (0.0, 0.0)), observation(), PLAN)


def test_a_doorway_is_a_frontier_to_look_through() -> None:
    grid = walled()
    for degree in range(-20, 21):
        for _ in range(20):
            grid.add(Ray((0.0, 0.0), math.radians(degree), 4.0, 0.01, False, 0.0))
    assert frontiers(grid).any()
    look, *_ = looks(ways_from(grid, (0.0, 0.0)), observation(), PLAN)
    for place in look.at_ne_m:
        assert abs(math.atan2(place[1], place[0])) < math.radians(25)


def test_walls_seen_only_from_afar_are_looked_at_again_from_nearer() -> None:
    grid = Occupancy()
    for degree in range(360):
        for _ in range(3):
            grid.add(Ray((0.0, 0.0), math.radians(degree), 3.5, 0.08, True, 0.0))
            grid.add(Ray((0.0, 0.0), math.radians(degree), 3.4, 0.0, False, 0.0))
    assert vague_surfaces(grid).any()
    look, *_ = looks(ways_from(grid, (0.0, 0.0)), observation(), PLAN)
    assert math.dist(look.from_ne_m, look.at_ne_m[0]) < 2.5


def test_of_a_wall_seen_well_from_one_side_only_the_other_is_looked_at() -> None:
    """The wall is 0.2 m thick: from one side only half of it is mapped."""
    grid = open_ground(1.5, (-2.0, 0.0))
    look_round(grid, (2.0, 0.0), 1.5, hit=False)
    near_side_m, far_side_m = -0.1, 0.1
    for centimetre in range(-100, 101, 5):
        east_m = 0.01 * centimetre
        for _ in range(8):
            grid.add(Ray((-2.0, east_m), 0.0, near_side_m + 2.0, 0.02, True, 0.0))
            grid.add(Ray((2.5, east_m), math.pi, 2.5 - far_side_m, 0.08, True, 0.0))
            grid.add(Ray((2.5, east_m), math.pi, 2.4 - far_side_m, 0.0, False, 0.0))
    rows = np.argwhere(vague_surfaces(grid))[:, 0]
    norths_m = [grid.place((row, 0))[0] for row in rows.tolist()]
    assert norths_m
    assert min(norths_m) > far_side_m
    edge = np.argwhere(frontiers(grid)).tolist()
    tried = Viewpoint((0.0, 0.0), tuple(grid.place((row, column)) for row, column in edge))
    ways = ways_from(grid, (2.0, 0.0))
    look, *_ = looks(ways, observation((2.0, 0.0)), PLAN, (tried,) * TRIES)
    assert look.from_ne_m[0] > far_side_m + 0.5


def test_what_is_small_is_left_until_nothing_large_is_left() -> None:
    grid = walled(reach_m=2.5)
    for degree in (*range(-15, 16), 90):
        for _ in range(20):
            grid.add(Ray((0.0, 0.0), math.radians(degree), 3.5, 0.01, False, 0.0))
    ways = ways_from(grid, (0.0, 0.0))
    large = looks(ways, observation(), PLAN)
    assert large
    assert all(len(look.at_ne_m) >= MIN_SHOWN for look in large)
    small = looks(ways, observation(), PLAN, large * TRIES)
    assert small
    assert all(len(look.at_ne_m) < MIN_SHOWN for look in small)


def test_what_a_look_has_left_unseen_is_looked_at_from_elsewhere() -> None:
    ways = ways_from(open_ground(), (0.0, 0.0))
    first, *_ = looks(ways, observation(), PLAN)
    for look in looks(ways, observation(), PLAN, (first,)):
        is_it_again = [min(math.dist(a, b) for b in first.at_ne_m) < 0.2 for a in look.at_ne_m]
        assert math.dist(look.from_ne_m, first.from_ne_m) > 0.3 or not any(is_it_again)


def test_what_was_looked_at_often_enough_is_let_be() -> None:
    grid = open_ground()
    everywhere = tuple(
        (3.95 * math.cos(math.radians(d)), 3.95 * math.sin(math.radians(d))) for d in range(360)
    )
    ways = ways_from(grid, (0.0, 0.0))
    tried = (Viewpoint((1.0, 0.0), everywhere),) * TRIES
    assert looks(ways, observation(), PLAN, tried[1:])
    assert not looks(ways, observation(), PLAN, tried)


def test_a_frontier_shows_from_before_it_and_not_from_its_side() -> None:
    grid = open_ground()
    frontier = grid.cell((0.0, 2.0))
    known = known_cells(grid)
    known[:, frontier[1] + 1 :] = False
    before, beside = grid.cell((0.0, 0.5)), grid.cell((1.5, 2.0))
    [shown] = sights(grid, known, np.array([before, beside]), np.array([frontier]))
    assert shown.tolist() == [0, 0]


def test_a_frontier_is_looked_at_from_where_something_shows_behind_it() -> None:
    """Not from the side, where the line continues through known space."""
    grid = open_ground()
    known = known_cells(grid)
    for look in looks(ways_from(grid, (0.0, 0.0)), observation(), PLAN):
        from_north_m, from_east_m = look.from_ne_m
        for north_m, east_m in look.at_ne_m:
            away_m = math.hypot(north_m - from_north_m, east_m - from_east_m)
            beyond = np.arange(0.1, 0.55, 0.1) / away_m
            cells = [
                grid.cell(
                    (north_m + b * (north_m - from_north_m), east_m + b * (east_m - from_east_m))
                )
                for b in beyond.tolist()
            ]
            assert not all(grid.has(cell) and known[cell] for cell in cells)


def test_outside_only_what_is_near_to_something_is_looked_at() -> None:
    grid = open_ground()
    ways = ways_from(grid, (0.0, 0.0))
    assert not looks(ways, observation(), OUTSIDE)
    assert looks(ways, observation(), PLAN)
    grid.block((3.0, 0.0), 0.3)
    for plan in (OUTSIDE, PLAN):
        found = looks(ways_from(grid, (0.0, 0.0)), observation(), plan)
        assert all(place[0] > 0 for look in found for place in look.at_ne_m)


@pytest.mark.parametrize("plan", [PLAN, OUTSIDE], ids=["in", "outside"])
def test_unknown_space_amid_known_is_looked_at(plan: MissionConfig) -> None:
    grid = Occupancy()
    for degree in range(0, 360, 40):
        bearing_rad = math.radians(degree)
        look_round(grid, (7 * math.cos(bearing_rad), 7 * math.sin(bearing_rad)), 3.0, hit=False)
    found = looks(ways_from(grid, (7.0, 0.0)), observation((7.0, 0.0)), plan)
    assert found
    assert all(math.hypot(*place) < 5 for look in found for place in look.at_ne_m)


def test_in_a_building_the_open_is_left_for_the_end_and_not_gone_far_into() -> None:
    here, pillar = (1.0, 0.0), tuple((0.1 * i, 0.1 * j) for i in range(-4, 5) for j in range(-4, 5))
    for reach_m, plan, has_more in ((4.0, OUTSIDE, False), (4.0, PLAN, True), (8.0, PLAN, False)):
        grid = open_ground(reach_m)
        grid.block((0.0, 0.0), 0.3)
        seen_enough = (Viewpoint((1.5, 0.0), pillar),) * TRIES
        assert bool(looks(ways_from(grid, here), observation(here), plan, seen_enough)) == has_more


@pytest.mark.parametrize(("strip_m", "is_open"), [(10, False), (34, True)])
def test_the_open_counts_when_all_else_is_far(strip_m: int, is_open: bool) -> None:
    """A hall wider than two ranges is open, too; only the outside has no end."""
    here, grid = (1.0, 0.0), open_ground(4.0)
    pillar = tuple((0.1 * i, 0.1 * j) for i in range(-4, 5) for j in range(-4, 5))
    grid.block((0.0, 0.0), 0.3)
    for north_m in range(4, strip_m, 2):
        look_round(grid, (float(north_m), 0.0), 2.0, hit=False)
    grid.block((strip_m + 1.0, 0.0), 0.3)
    seen_enough = (Viewpoint((1.5, 0.0), pillar),) * TRIES
    found = looks(ways_from(grid, here), observation(here), PLAN, seen_enough)
    assert found[0].is_open == is_open


def test_when_look_after_look_into_the_open_shows_nothing_it_is_let_be() -> None:
    ways, inside = ways_from(open_ground(), (0.0, 0.0)), Viewpoint((0.0, 0.0), ((9.0, 9.0),))
    into_the_open = replace(inside, is_open=True)
    assert looks(ways, observation(), PLAN, (into_the_open,) * (OPEN_LOOKS - 1))
    assert looks(ways, observation(), PLAN, (*(into_the_open,) * OPEN_LOOKS, inside))
    assert not looks(ways, observation(), PLAN, (into_the_open,) * OPEN_LOOKS)


def test_what_lies_on_the_way_home_is_left_for_the_way_home() -> None:
    ways = ways_from(open_ground(), (0.0, 0.0))
    near, far, home = (0.0, -1.0), (0.0, 3.0), (0.0, -3.0)
    assert first_of_tour(ways, (near, far), home) == 1
    assert first_of_tour(ways, (near, far), (0.0, 4.0)) == 0


@given(st.integers(1, 5), st.integers(0, 1000))
def test_the_tour_is_the_shortest_of_all(count: int, seed: int) -> None:
    places = np.random.default_rng(seed).uniform(-5, 5, (count + 1, 2))
    between = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    here, home = np.hypot(*places.T)[:-1], between[:-1, -1]

    def length(order: tuple[int, ...]) -> float:
        legs = sum(float(between[a, b]) for a, b in pairwise(order))
        return float(here[order[0]]) + legs + float(home[order[-1]])

    best = min(permutations(range(count)), key=length)
    assert shortest_first(here, between[:-1, :-1], home) == best[0]


def followed(
    way: Way, at: Observation, grid: Occupancy | None = None, course: Course | None = NORTH
) -> Setpoint:
    return follow(way, course, at, grid or open_ground(), PLAN)


def test_it_turns_to_where_it_flies_and_is_slow_until_it_has() -> None:
    setpoint = followed(((0.0, 3.0),), observation(), course=None)
    assert setpoint.forward_m_s == pytest.approx(0)
    assert setpoint.right_m_s == pytest.approx(0)
    assert setpoint.yaw_rate_rad_s > 0
    half = followed(((3.0, 0.0),), observation(yaw_rad=0.7), course=None)
    assert 0.2 < math.hypot(half.forward_m_s, half.right_m_s) < 0.6
    assert followed(((3.0, 0.0),), observation(), course=None).forward_m_s > 0.9


@pytest.mark.parametrize(
    ("yaw_deg", "bearing_deg", "is_faced"), [(0, 5, True), (0, 40, False), (-40, 0, False)]
)
def test_a_course_is_faced_when_the_nose_has_pointed_along_it(
    yaw_deg: float, bearing_deg: float, is_faced: bool
) -> None:
    corner = math.cos(math.radians(bearing_deg)), math.sin(math.radians(bearing_deg))
    here = observation(yaw_rad=math.radians(yaw_deg))
    assert (faced(None, (corner,), here) is not None) == is_faced


def test_a_course_stays_faced_until_the_way_bends() -> None:
    turned = observation(yaw_rad=math.radians(45))
    still = faced(NORTH, ((3.0, 1.0),), turned)
    assert still is not None
    assert still.bearing_rad == NORTH.bearing_rad
    assert faced(NORTH, ((1.0, -1.0),), turned) is None


def test_it_slows_down_where_it_is_narrow() -> None:
    grid = open_ground()
    wide = followed(((3.0, 0.0),), observation(), grid)
    grid.block((0.6, 0.5), 0.1)
    narrow = followed(((3.0, 0.0),), observation(), grid)
    assert narrow.forward_m_s < 0.5 * wide.forward_m_s


@pytest.mark.parametrize("beside_m", [0.6, 9.0])
@pytest.mark.parametrize("gap_deg", [(40, 40), (40, 5), (5, 40), (0, 0)])
def test_it_swings_its_nose_to_where_gaps_are_left_and_keeps_to_its_way(
    beside_m: float, gap_deg: tuple[int, int]
) -> None:
    grid = open_ground()
    grid.block((1.0, -beside_m), 0.1)
    left_deg, right_deg = gap_deg
    lane = Lane(left_rad=math.radians(left_deg), right_rad=math.radians(right_deg))
    way, course, yaws_deg = ((3.0, 0.0),), faced(None, ((3.0, 0.0),), observation()), [0.0]
    for tick in range(200):
        yaw_rad = math.radians(yaws_deg[-1])
        here = observation(yaw_rad=yaw_rad, time_s=0.05 * tick, place=(1.0, 0.0))
        course = faced(course, way, replace(here, lane=lambda _: lane))
        setpoint = followed(way, here, grid, course)
        course_rad = yaw_rad + math.atan2(setpoint.right_m_s, setpoint.forward_m_s)
        assert math.hypot(setpoint.forward_m_s, setpoint.right_m_s) > 0.2
        assert course_rad == pytest.approx(0, abs=1e-6)
        yaws_deg.append(yaws_deg[-1] + 0.05 * math.degrees(setpoint.yaw_rate_rad_s))
    assert min(yaws_deg) == pytest.approx(-max(left_deg, 3), abs=3)
    assert max(yaws_deg) == pytest.approx(max(right_deg, 3), abs=3)


def test_lost_near_to_a_wall_met_long_ago_it_is_slow_as_if_it_were_beside_it() -> None:
    grid, way = open_ground(), ((3.0, 0.0),)
    grid.block((1.0, -1.2), 0.1)
    sure = observation(place=(1.0, 0.0), time_s=120.0)
    lost = replace(sure, pose=replace(sure.pose, position_sigma_m=0.45))
    assert followed(way, lost, grid).forward_m_s < followed(way, sure, grid).forward_m_s


def test_far_from_its_start_it_knows_where_a_wall_is_that_it_met_just_now() -> None:
    grid, way = open_ground(), ((3.0, 0.0),)
    grid.block((1.0, -1.2), 0.1)
    sure = observation(place=(1.0, 0.0), time_s=5.0)
    far = replace(sure, pose=replace(sure.pose, position_sigma_m=0.45))
    assert followed(way, far, grid) == followed(way, sure, grid)


def test_beside_a_wall_that_the_map_has_elsewhere_it_is_slow() -> None:
    way, alone = ((3.0, 0.0),), observation(place=(1.0, 0.0), time_s=5.0)
    near = {**alone.ranges, Beam.LEFT: RangeReading(RangeState.TOO_NEAR)}
    free, beside = followed(way, alone), followed(way, replace(alone, ranges=near))
    assert beside.forward_m_s < 0.5 * free.forward_m_s


def test_what_the_turned_nose_meets_beside_the_way_does_not_stop_it() -> None:
    grid, way = open_ground(), ((3.0, 0.0),)
    grid.block((0.6, -0.7), 0.1)
    left_rad = math.radians(-35)
    beside = followed(way, observation((0.0, 0.0), left_rad, 1.0), grid)
    assert beside.forward_m_s > 0.2
    before = followed(way, observation((0.0, 0.0), left_rad, 0.65), grid)
    assert before.forward_m_s == 0


def test_it_stops_before_what_stands_in_the_way() -> None:
    way = ((3.0, 0.0),)
    assert is_blocked(way, observation(ahead_m=0.5))
    assert not is_blocked(way, observation(ahead_m=3.0))
    assert followed(way, observation(ahead_m=0.5)).forward_m_s == 0


def test_corners_that_are_near_are_passed() -> None:
    assert passed(((0.05, 0.0),), observation(), ARRIVED_M) == ()
    assert passed(((0.05, 0.0), (2.0, 0.0)), observation(), ARRIVED_M) == ((2.0, 0.0),)


# Travel


def gone(
    travel: Travel, grid: Occupancy, *, ahead_m: float = 5.0, time_s: float = 10.0
) -> tuple[Travel, Setpoint]:
    return travelling.step(travel, observation(ahead_m=ahead_m, time_s=time_s), grid, PLAN)


def to_turn_to_rad(travel: Travel) -> tuple[float, ...]:
    """Remaining headings of the sweep."""
    assert travel.sweep is not None
    return travel.sweep.headings_rad


def test_it_flies_to_its_goal_and_arrives() -> None:
    travel, setpoint = gone(Travel((3.0, 0.0)), open_ground())
    assert travel.phase is TravelPhase.FLY
    assert setpoint.forward_m_s > 0.5
    travel, _ = gone(Travel((0.05, 0.0)), open_ground())
    assert travel.phase is TravelPhase.ARRIVED
    assert gone(travel, open_ground())[0].phase is TravelPhase.ARRIVED


def with_doorway(ahead_m: float) -> Occupancy:
    grid = open_ground()
    for row in range(-40, 41):
        if abs(0.1 * row + 0.05) > 0.5:
            grid.block((ahead_m, 0.1 * row + 0.05), 0.01)
    return grid


def test_a_doorway_is_passed_squarely_through_its_middle() -> None:
    travel, _ = gone(Travel((3.0, 1.5)), with_doorway(1.45))
    before, after = travel.way[:2]
    assert before[0] < 1.45 < after[0]
    for _, east_m in (before, after):
        assert east_m == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(("half_m", "arrives"), [(0.55, True), (1.5, False)])
def test_between_walls_that_keep_it_off_it_has_arrived_where_it_gets_no_nearer(
    half_m: float, arrives: bool
) -> None:
    grid = open_ground()
    for row, side in product(range(-20, 21), (-1, 1)):
        grid.block((0.1 * row + 0.05, side * half_m), 0.01)
    travel = Travel((0.25, 0.0))
    for second in range(6):
        travel, _ = gone(travel, grid, time_s=10.0 + second)
    assert (travel.phase is TravelPhase.ARRIVED) is arrives


@pytest.mark.parametrize(("half_m", "is_stuck"), [(0.55, True), (1.5, False)])
def test_between_walls_to_and_fro_is_not_getting_on(half_m: float, *, is_stuck: bool) -> None:
    grid = open_ground()
    for row, side in product(range(-6, 7), (-1, 1)):
        grid.block((0.1 * row + 0.05, side * half_m), 0.01)
    travel = Travel((3.0, 0.0))
    for second in range(14):
        seen = observation((0.3 * (second // 3 % 2), 0.0), time_s=10.0 + second)
        travel, _ = travelling.step(travel, seen, grid, PLAN)
    assert travel.looked_round is is_stuck


def test_a_wall_on_one_side_is_no_doorway() -> None:
    grid = open_ground()
    for row in range(-40, 41):
        grid.block((0.1 * row + 0.05, -0.6), 0.01)
    travel, _ = gone(Travel((3.0, 0.0)), grid)
    assert travel.doorways == ()


def test_before_a_doorway_it_looks_at_both_jambs_and_goes_on() -> None:
    grid = with_doorway(1.45)
    travel, setpoint = gone(Travel((3.0, 0.0)), grid)
    assert travel.phase is TravelPhase.SWEEP
    assert setpoint.forward_m_s == 0
    looked_rad = []
    while travel.phase is TravelPhase.SWEEP:
        looked_rad.append(to_turn_to_rad(travel)[0])
        seen = observation(yaw_rad=looked_rad[-1])
        travel, _ = travelling.step(travel, seen, grid, PLAN)
    assert min(looked_rad) < -0.5 < 0.5 < max(looked_rad)
    travel, setpoint = gone(travel, grid)
    assert travel.phase is TravelPhase.FLY
    assert setpoint.forward_m_s > 0


def looked_at_again_if_narrow(
    travel: Travel, grid: Occupancy, width_m: float
) -> tuple[Travel, float]:
    """Sweeps the opening, twice if it looks narrow; returns the journey and the time."""
    travel, time_s = looked_at(travel, grid, width_m)
    if travel.known[0].looks_narrow:
        travel, time_s = looked_at(travel, grid, width_m, time_s=time_s + 0.05)
    return travel, time_s


def looked_at(
    travel: Travel,
    grid: Occupancy,
    width_m: float,
    place: Place = (0.0, 0.0),
    time_s: float = 10.0,
) -> tuple[Travel, float]:
    """The journey after a sweep of both jambs, 1.45 m north, and the time."""
    heading = 1.0 if place[0] < 1.45 else -1.0
    seen = observation(place, math.acos(heading), time_s=time_s)
    travel, _ = travelling.step(travel, seen, grid, PLAN)
    assert travel.phase is TravelPhase.SWEEP
    yaw_rad = to_turn_to_rad(travel)[0]
    while travel.phase is TravelPhase.SWEEP:
        time_s += 0.05
        east_m = place[1] + (1.45 - place[0]) * math.tan(yaw_rad)
        away_m = math.dist(place, (1.45, east_m)) if abs(east_m) > 0.5 * width_m else 5.0
        seen = observation(place, yaw_rad, away_m, time_s)
        travel, setpoint = travelling.step(travel, seen, grid, PLAN)
        yaw_rad += 0.05 * setpoint.yaw_rate_rad_s
    return travel, time_s


@pytest.mark.parametrize(("width_m", "enters"), [(0.7, False), (0.74, False), (0.9, True)])
def test_an_opening_narrower_than_a_door_is_not_entered_once_it_was_measured(
    width_m: float, *, enters: bool
) -> None:
    """All openings are free cells. A reading every 3 cm, without noise, measures 1 to 6 cm more."""
    grid = with_doorway(1.45)
    travel, time_s = looked_at_again_if_narrow(Travel((3.0, 0.0)), grid, width_m)
    travel, _ = gone(travel, grid, time_s=time_s + 0.05)
    assert travel.phase is (TravelPhase.FLY if enters else TravelPhase.GAVE_UP)
    later = onward(travel, (3.0, 0.5), ARRIVED_M)
    later = replace(later, known=tuple(replace(d, swept_s=-math.inf) for d in later.known))
    later, _ = gone(later, grid, time_s=time_s + 60.0)
    assert bool(later.doorways) is enters


def test_a_doorway_that_looked_too_narrow_once_is_looked_at_again_and_entered() -> None:
    grid = with_doorway(1.45)
    travel, time_s = looked_at(Travel((3.0, 0.0)), grid, 0.7)
    travel, time_s = looked_at(travel, grid, 0.9, time_s=time_s + 0.05)
    travel, _ = gone(travel, grid, time_s=time_s + 0.05)
    assert travel.phase is TravelPhase.FLY
    assert travel.doorways


def test_a_step_of_the_pose_while_it_looks_does_not_make_a_doorway_narrower() -> None:
    met = ((1.45, 0.45), (1.45, 0.5))
    seen = observation()
    doorway = Doorway(0, (1.45, 0.0), (1.0, 0.0), 0.45)
    looking = replace(over_jambs(doorway, seen), met_ne_m=met)
    moved = replace(seen, pose=replace(seen.pose, east_m=-0.3, reset_counter=1))
    looking, _ = sweeping.step(looking, moved, PLAN)
    assert np.array(looking.met_ne_m) == pytest.approx(np.array([(1.45, 0.15), (1.45, 0.2)]))


def test_home_it_goes_through_whatever_is_wide_enough_to_fly() -> None:
    grid = with_doorway(1.45)
    travel, time_s = looked_at(Travel((0.0, 0.0)), grid, 0.75, (2.9, 0.0))
    seen = observation((2.9, 0.0), math.pi, time_s=time_s + 0.05)
    travel, _ = travelling.step(travel, seen, grid, PLAN)
    assert travel.phase is TravelPhase.FLY
    assert travel.way[-1] == (0.0, 0.0)


def test_through_an_opening_that_it_came_by_it_goes_again_however_narrow() -> None:
    grid = with_doorway(1.45)
    for decimetre in range(26):
        grid.add(Ray((0.1 * decimetre, 0.0), 0.0, 0.5, 0.01, is_hit=False, time_s=0.0))
    travel, time_s = looked_at_again_if_narrow(Travel((3.0, 0.0)), grid, 0.75)
    travel, _ = gone(travel, grid, time_s=time_s + 0.05)
    assert travel.phase is TravelPhase.FLY


def test_too_near_to_a_doorway_to_measure_its_jambs_it_backs_off_first() -> None:
    travel, _ = gone(Travel((3.0, 0.0)), with_doorway(0.85))
    assert travel.phase is TravelPhase.FLY
    assert travel.way[0][0] < -0.2


def test_where_it_has_no_room_to_turn_it_does_not_back_off() -> None:
    grid = with_doorway(0.85)
    for row, side in product(range(-40, 8), (-1, 1)):
        grid.block((0.1 * row + 0.05, side * 0.65), 0.01)
    travel, _ = gone(Travel((3.0, 0.0)), grid)
    assert travel.phase is TravelPhase.FLY
    assert min(corner[0] for corner in travel.way) > 0


def test_a_step_of_the_pose_does_not_move_it_while_it_looks() -> None:
    grid = with_doorway(1.45)
    travel, _ = gone(Travel((3.0, 0.0)), grid)
    seen = observation((0.0, 0.3))
    stepped = replace(seen, pose=replace(seen.pose, reset_counter=1))
    travel, setpoint = travelling.step(travel, stepped, grid, PLAN)
    assert (setpoint.forward_m_s, setpoint.right_m_s) == (0.0, 0.0)


def test_in_a_corridor_it_goes_aside_to_see_the_jambs() -> None:
    grid = with_doorway(0.65)
    for row in range(-40, 41):
        grid.block((-1.0, 0.1 * row + 0.05), 0.01)
    travel, _ = gone(Travel((3.0, 0.0)), grid)
    aside = travel.way[0]
    assert travel.phase is TravelPhase.FLY
    assert abs(aside[1]) > 0.8
    travel, _ = travelling.step(travel, observation(aside), grid, PLAN)
    assert travel.phase is TravelPhase.SWEEP


def test_a_doorway_just_looked_at_is_not_looked_at_again() -> None:
    for swept_s, phase in ((5.0, TravelPhase.FLY), (-50.0, TravelPhase.SWEEP)):
        doorway = Doorway(0, (1.45, 0.0), (1.0, 0.0), 0.5, swept_s)
        travel, _ = gone(Travel((3.0, 0.0), known=(doorway,)), with_doorway(1.45))
        assert travel.phase is phase


@pytest.mark.parametrize("through", [1.0, -1.0])
def test_a_doorway_found_once_is_remembered_where_its_jambs_are_not_seen(through: float) -> None:
    doorway = Doorway(3, (1.45, 0.1), (through, 0.0), 0.5)
    travel, _ = gone(Travel((3.0, 0.0), known=(doorway,)), open_ground())
    assert travel.phase is TravelPhase.SWEEP
    aside = replace(doorway, middle_ne_m=(1.45, 1.0))
    travel, _ = gone(Travel((3.0, 0.0), known=(aside,)), open_ground())
    assert travel.phase is TravelPhase.FLY


def test_it_waits_for_who_stands_in_the_way() -> None:
    travel, _ = gone(Travel((3.0, 0.0)), open_ground())
    travel, setpoint = gone(travel, open_ground(), ahead_m=0.6, time_s=10.05)
    assert travel.phase is TravelPhase.FLY
    assert setpoint.forward_m_s == 0


def test_it_goes_round_who_has_stood_there_for_a_while() -> None:
    travel, _ = gone(Travel((3.0, 0.0)), open_ground())
    grid = open_ground()
    grid.block((1.2, 0.0), 0.2)
    travel, _ = gone(travel, grid, time_s=13.0)
    assert travel.phase is TravelPhase.FLY
    assert max(abs(east_m) for _, east_m in travel.way) > 0.4


def test_without_a_way_it_turns_all_round_once_and_then_gives_up() -> None:
    grid, time_s = walled(reach_m=2.0), 10.0
    travel, _ = gone(Travel((5.0, 0.0)), grid)
    assert travel.phase is TravelPhase.SWEEP
    turned = len(to_turn_to_rad(travel))
    while travel.phase is TravelPhase.SWEEP:
        time_s += 0.05
        seen = observation(yaw_rad=to_turn_to_rad(travel)[0], time_s=time_s)
        travel, _ = travelling.step(travel, seen, grid, PLAN)
    assert turned == 3
    travel, setpoint = gone(travel, grid, time_s=time_s + 2)
    assert travel.phase is TravelPhase.GAVE_UP
    assert setpoint == HOLD


@pytest.mark.parametrize(("roomy", "looks"), [((0.0, -1.5), True), ((0.0, 2.5), False)])
def test_it_goes_back_to_look_round_only_where_the_straight_way_is_free(
    roomy: Place, *, looks: bool
) -> None:
    """The drone is in a doorway. A wall 1.5 m east, which it flew round, is between."""
    grid = walled(reach_m=2.0)
    for jamb_m in (-0.6, 0.6):
        grid.block((jamb_m, 0.0), 0.01)
    for decimetre in range(-20, 21):
        grid.block((0.1 * decimetre + 0.05, 1.5), 0.1)
    travel, setpoint = gone(Travel((5.0, 0.0), roomy_ne_m=roomy), grid)
    assert travel.phase is (TravelPhase.SWEEP if looks else TravelPhase.GAVE_UP)
    assert looks or setpoint == HOLD


def test_having_looked_round_beside_a_doorway_it_goes_on_and_has_not_arrived() -> None:
    grid, time_s = with_doorway(0.45), 10.0
    travel, _ = gone(Travel((3.0, 0.0)), grid)
    sweep = Sweep((0.0,), (0.0, 0.0), resets=0)
    travel = replace(travel, way=(), phase=TravelPhase.SWEEP, sweep=sweep, looked_round=True)
    for _ in range(2):
        time_s += 0.05
        travel, _ = gone(travel, grid, time_s=time_s)
    assert travel.phase is TravelPhase.FLY
    assert travel.way[-1] == (3.0, 0.0)


@pytest.mark.parametrize(("goal", "goes"), [((0.0, 0.0), True), ((-1.0, 0.0), False)])
def test_home_it_goes_as_it_came_whatever_is_drawn_there(goal: Place, *, goes: bool) -> None:
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
def test_stuck_before_a_doorway_it_goes_by_another_if_there_is_one(*, has_another: bool) -> None:
    grid = with_doorway(1.0)
    if has_another:
        for centimetre in range(-39, 40, 3):
            east_m = 2.5 + 0.01 * centimetre
            for _ in range(20):
                grid.add(Ray((0.0, east_m), 0.0, 2.0, 0.01, is_hit=False, time_s=0.0))
    travel, _ = gone(Travel((2.0, 0.0)), grid)
    assert max(abs(east_m) for _, east_m in travel.way) < 0.5
    travel = replace(travel, looked_round=True)
    travel, _ = gone(travel, grid, time_s=21.0)
    if has_another:
        assert travel.phase is TravelPhase.FLY
        assert max(east_m for _, east_m in travel.way) > 1.5
    else:
        assert travel.phase is TravelPhase.GAVE_UP


@pytest.mark.parametrize(("goal", "goes"), [((0.0, 0.0), True), ((0.0, 0.1), False)])
def test_stuck_on_its_way_home_it_goes_round_what_it_does_not_see(
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


def stuck_on_a_way(before: Travel | None) -> Travel:
    """The drone has turned all round, and is stuck at the start."""
    grid = open_ground()
    travel = replace(onward(before, (3.0, 0.0), ARRIVED_M), looked_round=True)
    for time_s in (10.0, 21.0):
        travel, _ = gone(travel, grid, time_s=time_s)
    return travel


def test_where_it_was_stuck_on_two_ways_nothing_is_looked_for_any_more() -> None:
    once = stuck_on_a_way(None)
    assert once.phase is TravelPhase.GAVE_UP
    assert stuck_twice(once) == ()
    twice = stuck_on_a_way(once)
    ahead, *_ = stuck_twice(twice)
    assert math.dist(ahead.middle_ne_m, (0.5, 0.0)) < 0.2
    grid = open_ground()
    for travel, leads_ahead in ((once, True), (twice, False)):
        explore = Explore(ExplorePhase.CHOOSE, came=travel)
        while explore.ways is None:
            explore, _ = step(explore, observation(), grid, PLAN)
        straight = max(abs(east_m) for _, east_m in explore.ways.to((1.5, 0.0))) < 0.3
        assert straight is leads_ahead


def test_a_place_given_up_is_remembered_for_the_next() -> None:
    explore, grid = going(open_ground()), open_ground()
    assert explore.look is not None
    stuck = replace(explore, travel=stuck_on_a_way(None))
    after, _ = step(stuck, observation(), grid, PLAN)
    assert after.phase is ExplorePhase.CHOOSE
    assert after.came is not None
    assert len(after.came.stuck_at) == 1


def test_with_no_way_on_it_turns_where_it_last_had_room_and_not_in_the_doorway() -> None:
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


# Transitions of the exploration


def test_look_turns_all_round_then_a_place_is_chosen() -> None:
    explore, grid, yaw_rad = Explore(), open_ground(), 0.0
    while explore.phase is ExplorePhase.LOOK:
        explore, setpoint = step(explore, observation(yaw_rad=yaw_rad), grid, PLAN)
        yaw_rad += 0.1
        assert setpoint.forward_m_s == pytest.approx(0, abs=1e-9)
    assert yaw_rad > math.tau
    assert chosen(explore, grid).phase is ExplorePhase.GO


def test_look_ends_the_mission_when_nothing_is_unseen() -> None:
    explore, _ = step(Explore(to_turn_rad=-0.1), observation(), walled(reach_m=2.0), PLAN)
    assert chosen(explore, walled(reach_m=2.0)).phase is ExplorePhase.DONE


def test_look_ends_early_when_all_that_it_is_for_was_seen() -> None:
    looking = Explore(look=Viewpoint((0.0, 0.0), ((3.9, 0.0),)), to_turn_rad=3.0)
    explore, _ = step(looking, observation(), walled(reach_m=2.0), PLAN)
    assert chosen(explore, walled(reach_m=2.0)).phase is ExplorePhase.DONE


def chosen(explore: Explore, grid: Occupancy) -> Explore:
    """The state after CHOOSE."""
    assert explore.phase is ExplorePhase.CHOOSE
    while explore.phase is ExplorePhase.CHOOSE:
        explore, _ = step(explore, observation(), grid, PLAN)
    return explore


def going(grid: Occupancy) -> Explore:
    explore = chosen(Explore(ExplorePhase.CHOOSE), grid)
    assert explore.phase is ExplorePhase.GO
    return explore


def test_go_looks_round_on_arrival() -> None:
    explore = going(open_ground())
    assert explore.travel is not None
    there = observation(explore.travel.goal_ne_m)
    explore, _ = step(explore, there, open_ground(), PLAN)
    assert explore.phase is ExplorePhase.LOOK
    assert explore.look is not None


def arrived(*bearings_deg: float, yaw_rad: float = 0.0) -> Explore:
    """A viewpoint at the origin with targets at the edge of known space in these directions."""
    rim = [
        (3.95 * math.cos(math.radians(b)), 3.95 * math.sin(math.radians(b))) for b in bearings_deg
    ]
    here = (0.0, 0.0)
    going = Explore(
        ExplorePhase.GO, travel=Travel(here, course=NORTH), look=Viewpoint(here, tuple(rim))
    )
    return step(going, observation(here, yaw_rad=yaw_rad), open_ground(), PLAN)[0]


@pytest.mark.parametrize("clockwise", [True, False])
def test_it_turns_the_way_that_shows_what_it_came_for_sooner(clockwise: bool) -> None:
    side = 1 if clockwise else -1
    for ahead, beside in ((20, 30), (100, 110)):
        looking = arrived(side * ahead, side * beside)
        assert looking.phase is ExplorePhase.LOOK
        assert looking.clockwise is clockwise
        assert math.radians(20) < looking.to_turn_rad < math.radians(60)


def test_it_does_not_turn_when_all_that_it_came_for_was_seen_on_the_way() -> None:
    here = (0.0, 0.0)
    going = Explore(
        ExplorePhase.GO, travel=Travel(here, course=NORTH), look=Viewpoint(here, ((1.0, 0.0),))
    )
    explore, _ = step(going, observation(here), open_ground(), PLAN)
    assert explore.phase is ExplorePhase.CHOOSE


def test_while_it_turns_it_goes_on_to_where_it_looks_from() -> None:
    looking = replace(arrived(100), here_ne_m=(0.0, 1.5))
    _, setpoint = step(looking, observation(), open_ground(), PLAN)
    assert setpoint.right_m_s > 0.5
    assert setpoint.yaw_rate_rad_s > 0


def test_go_takes_another_place_where_there_is_no_way() -> None:
    explore = going(open_ground())
    stuck = replace(explore, travel=Travel((9.0, 9.0), phase=TravelPhase.GAVE_UP))
    another, _ = step(stuck, observation(), open_ground(), PLAN)
    assert another.tried == (explore.look,)
    assert chosen(another, open_ground()).phase is ExplorePhase.GO


def test_it_tells_whether_it_goes_to_the_unseen_or_to_walls_known_before() -> None:
    explore = going(open_ground())
    assert explore.activity == "going to where something is unseen"
    assert explore.look is not None
    tie = replace(explore, look=replace(explore.look, is_tie=True))
    assert tie.activity == "going to look again at walls that are not known well"


def test_go_chooses_again_when_what_it_goes_for_was_seen_on_the_way() -> None:
    explore = going(open_ground())
    explore, setpoint = step(explore, observation(time_s=20.0), open_ground(reach_m=9.0), PLAN)
    assert explore.phase is ExplorePhase.CHOOSE
    assert setpoint != HOLD  # it continues to fly meanwhile
    assert chosen(explore, walled(reach_m=2.0)).phase is ExplorePhase.DONE


def test_what_was_seen_on_the_way_counts_as_looked_at() -> None:
    explore = going(open_ground())
    after, _ = step(explore, observation(time_s=20.0), walled(reach_m=2.0), PLAN)
    assert explore.look is not None
    assert [look.at_ne_m for look in after.tried] == [explore.look.at_ne_m]


def test_done_stays_done() -> None:
    explore, setpoint = step(Explore(ExplorePhase.DONE), observation(), walled(), PLAN)
    assert explore.phase is ExplorePhase.DONE
    assert setpoint == HOLD


# Transitions of the layers

LAYERED = MissionConfig(kind="layers")


def layer_sight(above_m: float, height_m: float = LAYERED.height_m) -> Observation:
    up = RangeReading(RangeState.DISTANCE, above_m, 0.01)
    at = Pose(10.0, 0.0, 0.0, -height_m, 0.0)
    return Observation(at, {Beam.FRONT: up, Beam.UP: up}, 0.0)


def test_a_layer_that_was_seen_ends_at_the_start() -> None:
    seen = Layers(explore=Explore(ExplorePhase.DONE))
    layers, _ = layering.step(seen, layer_sight(3.0), open_ground(), LAYERED)
    assert layers.phase is LayersPhase.RETURN


def test_from_the_start_it_climbs_while_there_is_room_above() -> None:
    back = Layers(LayersPhase.RETURN)
    layers, _ = layering.step(back, layer_sight(2.5), open_ground(), LAYERED)
    assert (layers.phase, layers.number) == (LayersPhase.CLIMB, 1)
    assert layers.height_m(LAYERED) == pytest.approx(LAYERED.height_m + LAYERED.layer_spacing_m)
    layers, _ = layering.step(back, layer_sight(1.0), open_ground(), LAYERED)
    assert layers.phase is LayersPhase.OVERFLY


def test_without_a_way_back_the_layers_end() -> None:
    lost = Layers(LayersPhase.RETURN, travel=Travel((9.0, 9.0), phase=TravelPhase.GAVE_UP))
    layers, _ = layering.step(lost, layer_sight(3.0), open_ground(), LAYERED)
    assert layers.phase is LayersPhase.DONE


def test_at_its_new_height_it_looks_round_first() -> None:
    climbing = Layers(LayersPhase.CLIMB, number=1)
    layers, _ = layering.step(climbing, layer_sight(3.0), open_ground(), LAYERED)
    assert layers.phase is LayersPhase.CLIMB
    there = layer_sight(3.0, climbing.height_m(LAYERED))
    layers, _ = layering.step(climbing, there, Occupancy(), LAYERED)
    assert (layers.phase, layers.number) == (LayersPhase.EXPLORE, 1)
    assert layers.explore == Explore()


def test_all_layers_seen_stays_so() -> None:
    layers, setpoint = layering.step(Layers(LayersPhase.DONE), observation(), walled(), LAYERED)
    assert layers.phase is LayersPhase.DONE
    assert setpoint == HOLD

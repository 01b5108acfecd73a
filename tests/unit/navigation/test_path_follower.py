"""Speed, heading and stops along a path."""

import math
from dataclasses import replace

import pytest

from companion.core.messages import Beam, RangeReading, RangeState, Setpoint
from companion.mapping.occupancy import Occupancy
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
from companion.safety.swept_space import Lane
from tests.grids import (
    NORTH,
    PLAN,
    observation,
    open_ground,
)


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

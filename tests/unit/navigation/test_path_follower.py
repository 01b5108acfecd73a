"""Speed, heading and stops along a path."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from companion.core.known_walls import KnownWalls
from companion.core.messages import Beam, RangeReading, RangeState, Setpoint
from companion.mapping.occupancy import Occupancy
from companion.navigation.observation import Observation
from companion.navigation.path_follower import (
    ARRIVED_M,
    CORNER_M,
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


def test_the_drone_turns_to_its_course_and_is_slow_until_it_faces_it() -> None:
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


def test_a_course_stays_faced_until_the_path_bends() -> None:
    turned = observation(yaw_rad=math.radians(45))
    still = faced(NORTH, ((3.0, 1.0),), turned)
    assert still is not None
    assert still.bearing_rad == NORTH.bearing_rad
    assert faced(NORTH, ((1.0, -1.0),), turned) is None


def test_speed_is_lower_in_a_narrow_passage() -> None:
    grid = open_ground()
    wide = followed(((3.0, 0.0),), observation(), grid)
    grid.block((0.6, 0.5), 0.1)
    narrow = followed(((3.0, 0.0),), observation(), grid)
    assert narrow.forward_m_s < 0.5 * wide.forward_m_s


@pytest.mark.parametrize("beside_m", [0.6, 9.0])
@pytest.mark.parametrize("gap_deg", [(40, 40), (40, 5), (5, 40), (0, 0)])
def test_the_nose_swings_over_unswept_gaps_while_the_course_is_kept(
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


def test_speed_is_lower_near_an_old_wall_if_the_position_is_uncertain() -> None:
    grid, way = open_ground(), ((3.0, 0.0),)
    grid.block((1.0, -1.2), 0.1)
    sure = observation(place=(1.0, 0.0), time_s=120.0)
    lost = replace(sure, pose=replace(sure.pose, position_sigma_m=0.45))
    assert followed(way, lost, grid).forward_m_s < followed(way, sure, grid).forward_m_s


def test_position_uncertainty_does_not_slow_near_a_recently_detected_wall() -> None:
    grid, way = open_ground(), ((3.0, 0.0),)
    grid.block((1.0, -1.2), 0.1)
    sure = observation(place=(1.0, 0.0), time_s=5.0)
    far = replace(sure, pose=replace(sure.pose, position_sigma_m=0.45))
    assert followed(way, far, grid) == followed(way, sure, grid)


@pytest.mark.parametrize(("wall_east_m", "is_slowed"), [(-1.2, False), (-1.6, True)])
def test_position_uncertainty_does_not_slow_along_a_wall_that_is_measured(
    wall_east_m: float, is_slowed: bool
) -> None:
    """Its known part begins 1 m ahead."""
    grid, way = open_ground(), ((3.0, 0.0),)
    grid.block((1.0, -1.2), 0.1)
    wall = KnownWalls(
        np.array([[0.0, -1.0]]),
        np.array([-wall_east_m]),
        np.array([[2.0, 9.0]]),
        np.eye(1),
        np.array([120.0]),
    )
    sure = observation(place=(1.0, 0.0), time_s=120.0)
    lost = replace(
        sure,
        pose=replace(sure.pose, position_sigma_m=0.45),
        walls=lambda: wall,
    )
    slowed = followed(way, lost, grid).forward_m_s < followed(way, sure, grid).forward_m_s
    assert slowed == is_slowed


def test_a_too_near_side_reading_slows_although_the_map_has_no_wall_there() -> None:
    way, alone = ((3.0, 0.0),), observation(place=(1.0, 0.0), time_s=5.0)
    near = {**alone.ranges, Beam.LEFT: RangeReading(RangeState.TOO_NEAR)}
    free, beside = followed(way, alone), followed(way, replace(alone, ranges=near))
    assert beside.forward_m_s < 0.5 * free.forward_m_s


def test_an_obstacle_beside_the_path_does_not_stop_the_drone() -> None:
    grid, way = open_ground(), ((3.0, 0.0),)
    grid.block((0.6, -0.7), 0.1)
    left_rad = math.radians(-35)
    beside = followed(way, observation((0.0, 0.0), left_rad, 1.0), grid)
    assert beside.forward_m_s > 0.2
    before = followed(way, observation((0.0, 0.0), left_rad, 0.65), grid)
    assert before.forward_m_s == 0


def test_the_drone_stops_before_an_obstacle_on_the_path() -> None:
    way = ((3.0, 0.0),)
    assert is_blocked(way, observation(ahead_m=0.5))
    assert not is_blocked(way, observation(ahead_m=3.0))
    assert followed(way, observation(ahead_m=0.5)).forward_m_s == 0


def test_near_corners_of_the_path_are_passed() -> None:
    assert passed(((0.05, 0.0),), observation(), ARRIVED_M) == ()
    assert passed(((0.05, 0.0), (2.0, 0.0)), observation(), ARRIVED_M) == ((2.0, 0.0),)


TICK_S = 0.05


def flown(way: Way, lag_s: float) -> list[tuple[float, float]]:
    """Places, one a tick, of a point mass whose velocity follows the setpoint with `lag_s`."""
    place, velocity, places = 0j, 0j, [(0.0, 0.0)]
    course, left = Course(math.atan2(way[0][1], way[0][0])), way
    ground = open_ground(9.0)
    while left and len(places) < 60 / TICK_S:
        here = observation(places[-1], course.bearing_rad, 9.0, TICK_S * len(places))
        here = replace(here, lag_s=lag_s)
        left = passed(left, here, ARRIVED_M)
        setpoint = followed(left, here, ground, course) if left else Setpoint()
        wanted = complex(setpoint.forward_m_s, setpoint.right_m_s)
        velocity += (wanted - velocity) * (1 - math.exp(-TICK_S / lag_s))
        place += TICK_S * velocity
        places.append((place.real, place.imag))
    assert not left, "the drone did not arrive"
    return places


def to_path_m(place: tuple[float, float], way: Way) -> float:
    """Distance to the nearest leg."""
    legs = pairwise(complex(*corner) for corner in ((0.0, 0.0), *way))
    from_legs_m = []
    for start, end in legs:
        along = (complex(*place) - start) / (end - start)
        from_legs_m.append(abs(along - min(max(along.real, 0.0), 1.0)) * abs(end - start))
    return min(from_legs_m)


def bent(bend_deg: float, legs: int = 4, leg_m: float = 1.5) -> Way:
    """A path that bends to the right and to the left in turn."""
    corners, place = [], 0j
    for leg in range(legs):
        place += leg_m * complex(
            math.cos(math.radians(bend_deg * (leg % 2))),
            math.sin(math.radians(bend_deg * (leg % 2))),
        )
        corners.append((place.real, place.imag))
    return tuple(corners)


@pytest.mark.parametrize("lag_s", [0.2, 0.6])
@pytest.mark.parametrize("bend_deg", [5, 10, 20, 45, 90, 120])
def test_the_drone_keeps_to_the_path_at_its_corners(bend_deg: float, lag_s: float) -> None:
    way = bent(bend_deg)
    assert max(to_path_m(place, way) for place in flown(way, lag_s)) < CORNER_M + ARRIVED_M


def test_the_drone_keeps_its_speed_at_small_bends() -> None:
    straight, small, sharp = (len(flown(bent(bend_deg), 0.6)) for bend_deg in (0, 10, 90))
    assert small < 1.1 * straight
    assert sharp > 1.2 * straight

"""Tests that the limited velocity keeps the clearance from near obstacles."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.messages import Setpoint
from companion.safety.obstacle_memory import Surroundings
from companion.safety.swept_space import Lane
from companion.safety.velocity_guard import guarded
from tests.unit.safety.near_obstacles import CLEARANCE_M, FORWARD, Place

KEEP_OFF_M = 0.5


def wall(ahead_m: float, half_m: float = 1.0) -> list[Place]:
    """Points of a wall perpendicular to the nose."""
    return [(ahead_m, 0.05 * i) for i in range(-round(20 * half_m), round(20 * half_m) + 1)]


def doorway(width_m: float, ahead_m: float = 0.0, aside_m: float = 0.0) -> list[Place]:
    """Points of a doorway: two jambs and the wall on either side."""
    half_m = width_m / 2
    right = [(ahead_m, aside_m + half_m + 0.05 * i) for i in range(20)]
    left = [(ahead_m, aside_m - half_m - 0.05 * i) for i in range(20)]
    return right + left


def around(points: list[Place], speed: Place = (0.0, 0.0)) -> Surroundings:
    return Surroundings(np.array(points), speed)


def test_without_near_obstacles_the_setpoint_is_unchanged() -> None:
    assert guarded(FORWARD, Surroundings(), CLEARANCE_M) == FORWARD


def test_the_drone_slows_down_before_a_wall_and_stops_short_of_it() -> None:
    speeds = [
        guarded(FORWARD, around(wall(ahead_m)), CLEARANCE_M).forward_m_s
        for ahead_m in (3.0, 1.0, 0.7, KEEP_OFF_M)
    ]
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[0] == 1.0
    assert speeds[-1] <= 0


def test_a_faster_drone_slows_down_earlier() -> None:
    slow = guarded(FORWARD, around(wall(1.0), (0.1, 0.0)), CLEARANCE_M)
    fast = guarded(FORWARD, around(wall(1.0), (1.0, 0.0)), CLEARANCE_M)
    assert fast.forward_m_s < slow.forward_m_s


def test_the_yaw_rate_is_not_limited() -> None:
    assert guarded(FORWARD, around(wall(0.5)), CLEARANCE_M).yaw_rate_rad_s == 0.3


def test_the_drone_retreats_from_an_obstacle_that_is_too_near() -> None:
    assert guarded(Setpoint(), around(wall(0.4)), CLEARANCE_M).forward_m_s < 0


def test_the_drone_continues_along_a_wall() -> None:
    beside = [(along_m, 0.55) for along_m in np.linspace(-1, 1, 41)]
    speed = guarded(FORWARD, around(beside), CLEARANCE_M)
    assert speed.forward_m_s > 0.3
    assert -0.2 < speed.right_m_s <= 0


@pytest.mark.parametrize("width_m", [0.9, 1.0, 1.4])
def test_the_drone_passes_a_doorway_in_the_middle(width_m: float) -> None:
    assert guarded(FORWARD, around(doorway(width_m)), CLEARANCE_M).forward_m_s > 0.2
    before = guarded(FORWARD, around(doorway(width_m, ahead_m=0.3)), CLEARANCE_M)
    assert before.forward_m_s > 0.05


def test_the_drone_does_not_enter_a_doorway_that_is_too_narrow() -> None:
    for ahead_m in (0.2, 0.1):
        narrow = around(doorway(0.6, ahead_m))
        assert guarded(FORWARD, narrow, CLEARANCE_M).forward_m_s <= 0


def test_the_drone_moves_towards_the_middle_of_a_doorway() -> None:
    to_the_right = guarded(FORWARD, around(doorway(1.0, aside_m=0.1)), CLEARANCE_M)
    assert to_the_right.right_m_s > 0


@pytest.mark.parametrize("aside_m", [-0.06, 0.06])
def test_the_drone_keeps_to_the_middle_between_two_near_obstacles(aside_m: float) -> None:
    for setpoint in (Setpoint(), FORWARD):
        safe = guarded(setpoint, around(doorway(0.6, aside_m=aside_m)), CLEARANCE_M)
        assert safe.right_m_s * aside_m > 0
        assert abs(safe.right_m_s) > 0.02


@pytest.mark.parametrize("width_m", [0.9, 1.0, 1.2])
@pytest.mark.parametrize("askew_deg", [0, 20, 40, 60])
def test_the_drone_continues_along_a_corridor_at_an_oblique_heading(
    width_m: float, askew_deg: float
) -> None:
    along = np.array([math.cos(math.radians(askew_deg)), -math.sin(math.radians(askew_deg))])
    across = np.array([-along[1], along[0]])
    steps = [0.05 * i for i in range(-30, 31)]
    walls = [i * along + side * width_m / 2 * across for i in steps for side in (-1, 1)]
    safe = guarded(FORWARD, Surroundings(np.array(walls)), CLEARANCE_M)
    velocity = np.array([safe.forward_m_s, safe.right_m_s])
    assert velocity @ along > 0.3
    assert abs(velocity @ across) < 0.35


def test_the_drone_keeps_its_clearance_at_the_end_of_a_corridor() -> None:
    sides = [(0.05 * i, side * 0.45) for i in range(-30, 10) for side in (-1, 1)]
    end = [(KEEP_OFF_M, 0.05 * i) for i in range(-9, 10)]
    assert guarded(FORWARD, around(sides + end), CLEARANCE_M).forward_m_s <= 0


@given(
    st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), min_size=1, max_size=20),
    st.floats(-1, 1),
    st.floats(-1, 1),
)
def test_no_velocity_leads_towards_an_obstacle_within_35_centimetres(
    points: list[Place], forward_m_s: float, right_m_s: float
) -> None:
    safe = guarded(Setpoint(forward_m_s, right_m_s), around(points), CLEARANCE_M)
    for forward_m, right_m in points:
        away_m = math.hypot(forward_m, right_m)
        if 0.01 < away_m < 0.35:
            towards = (safe.forward_m_s * forward_m + safe.right_m_s * right_m) / away_m
            assert towards <= 0.03


@given(st.floats(0.25, 0.33), st.floats(0.75, 0.9), st.floats(-math.pi, math.pi))
def test_an_obstacle_of_a_minute_ago_does_not_push_the_drone_into_a_new_one(
    new_m: float, old_m: float, bearing_rad: float
) -> None:
    """A drone among legs was pushed into a pole 0.3 m beside by a post 0.9 m on the other side."""
    towards_new = np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
    beside = Surroundings(
        np.array([new_m * towards_new, -old_m * towards_new]),
        drift_m=np.array([0.06, 0.2]),
        is_among_legs=True,
    )
    safe = guarded(Setpoint(), beside, CLEARANCE_M)
    assert towards_new @ (safe.forward_m_s, safe.right_m_s) < -0.02


def test_the_drone_does_not_crawl_towards_a_pole_that_it_knows_only_from_afar() -> None:
    """A pole detected from 4 m stood 0.4 m from its nearest possible position."""
    unswept = Lane(clear_m=0.0)
    pole = np.array([[0.7, 0.7]])
    for is_inexact, speed_m_s in ((True, 0.0), (False, 0.2)):
        beside = Surroundings(pole, is_vague=np.array([is_inexact]), lane=lambda _: unswept)
        safe = guarded(FORWARD, beside, CLEARANCE_M)
        assert math.hypot(safe.forward_m_s, safe.right_m_s) == pytest.approx(speed_m_s, abs=0.01)

"""Tests the mean speed by which the time home is estimated among legs."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.messages import Pose
from companion.navigation.energy_reserve import (
    AMONG_LEGS_MEAN_M_S,
    AMONG_LEGS_PRIOR_S,
    ASK_AGAIN_S,
    ROUGHLY,
    STEP_M,
    Pace,
    Reserve,
    Spent,
    step,
)
from companion.navigation.observation import Observation
from companion.safety.obstacle_memory import AMONG_LEGS_S, FURNISHED_LEGS
from tests.grids import PLAN, observation, open_ground

TICK_S = 0.05


def flown(
    speed_m_s: float, lasts_s: float = 300.0, *, among_legs: bool = True, travels: bool = True
) -> Pace:
    """The pace after a straight flight."""
    pace = Pace()
    for tick in range(round(lasts_s / TICK_S)):
        at = Pose(tick * TICK_S, speed_m_s * tick * TICK_S, 0.0, -1.2, 0.0)
        seen = Observation(at, {}, 0.0, is_among_legs=among_legs)
        pace = pace.onward(tick * TICK_S, seen, travels=travels)
    return pace


@given(st.floats(0.02, AMONG_LEGS_MEAN_M_S))
def test_slow_journeys_among_legs_lower_the_mean_speed(speed_m_s: float) -> None:
    mean_m_s = flown(speed_m_s).mean_m_s
    assert speed_m_s - STEP_M / 300 <= mean_m_s <= 0.5 * (speed_m_s + AMONG_LEGS_MEAN_M_S) + 0.001


def test_sway_is_no_progress() -> None:
    pace = Pace()
    for tick in range(6000):
        at = Pose(tick * TICK_S, 0.03 * (tick % 2), 0.0, -1.2, 0.0)
        pace = pace.onward(
            tick * TICK_S, Observation(at, {}, 0.0, is_among_legs=True), travels=True
        )
    share = AMONG_LEGS_PRIOR_S / (AMONG_LEGS_PRIOR_S + 6000 * TICK_S)
    assert pace.mean_m_s == pytest.approx(share * AMONG_LEGS_MEAN_M_S, rel=0.01)


def test_fast_journeys_do_not_raise_it() -> None:
    assert flown(0.6).mean_m_s == pytest.approx(AMONG_LEGS_MEAN_M_S)


@pytest.mark.parametrize(("among_legs", "travels"), [(False, True), (True, False)])
def test_looking_round_and_open_space_do_not_count(among_legs: bool, travels: bool) -> None:
    pace = flown(0.01, among_legs=among_legs, travels=travels)
    assert pace.mean_m_s == pytest.approx(AMONG_LEGS_MEAN_M_S)


def test_the_way_between_two_journeys_does_not_count() -> None:
    pace = flown(0.1, 100.0)
    away = Observation(Pose(200.0, 50.0, 0.0, -1.2, 0.0), {}, 0.0, is_among_legs=True)
    paused = pace.onward(150.0, away, travels=False)
    resumed = paused.onward(200.0, away, travels=True)
    assert math.isclose(resumed.mean_m_s, pace.mean_m_s)


def turns_back_at_s(legs: int) -> int:
    """Time at which a drone 3 m from its start turns back for a limit of 300 s, s."""
    plan = PLAN.model_copy(update={"time_limit_s": 300.0})
    here = replace(observation((3.0, 0.0)), legs=legs, is_among_legs=legs > 0)
    reserve, ground = Reserve(), open_ground()
    for second in range(300):
        reserve, why = step(reserve, Spent(second, None), here, ground, plan, travels=False)
        if why:
            return second
    return 300


def test_each_leg_costs_time_on_the_way_home() -> None:
    """A drone that had seen two legs turned back with 60 % of its battery, 115 s from home."""
    none, one, two, many = (turns_back_at_s(legs) for legs in (0, 1, 2, FURNISHED_LEGS))
    assert 270 - AMONG_LEGS_S < none < 280
    for fewer, more in ((none, one), (one, two)):
        assert 0 <= fewer - more <= ROUGHLY * AMONG_LEGS_S + ASK_AGAIN_S
    assert many <= two
    assert many == pytest.approx(300 - ROUGHLY * 3.0 / AMONG_LEGS_MEAN_M_S, abs=60)

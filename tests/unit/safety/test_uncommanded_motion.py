"""The watch detects a fly-away, but no response to a setpoint or a gust."""

import math
from collections.abc import Callable

import pytest

from companion.core.messages import HOLD, Odometry, Setpoint
from companion.safety.health.uncommanded_motion import UncommandedMotionWatch

TICK_S = 0.05
AT_S = 10.0
Velocity = Callable[[float], tuple[float, float, float]]


def detected_s(
    velocity_ned_m_s: Velocity,
    asked: Callable[[float], Setpoint | None] = lambda now_s: HOLD,
    yaw_rad: Callable[[float], float] = lambda now_s: 0.0,
    until_s: float = 20.0,
) -> float:
    """Time of the detection, s; infinite if there is none."""
    watch = UncommandedMotionWatch()
    for tick in range(round(until_s / TICK_S)):
        now_s = tick * TICK_S
        watch.take(Odometry(now_s, (0, 0, 0), velocity_ned_m_s(now_s), yaw_rad(now_s)))
        watch.ask(now_s, asked(now_s), yaw_rad(now_s))
        if watch.has_flown_away:
            return now_s
    return math.inf


def from_then_on(rate_m_s2: float, now_s: float) -> float:
    return rate_m_s2 * max(0.0, now_s - AT_S)


@pytest.mark.parametrize("course_rad", [0.0, 1.0, math.pi, -2.0])
@pytest.mark.parametrize("forward_m_s", [0.0, 0.5])
def test_a_fly_away_is_detected_within_650_ms(course_rad: float, forward_m_s: float) -> None:
    def velocity(now_s: float) -> tuple[float, float, float]:
        speed = from_then_on(2.5, now_s)
        return forward_m_s + speed * math.cos(course_rad), speed * math.sin(course_rad), 0.0

    assert AT_S < detected_s(velocity, lambda now_s: Setpoint(forward_m_s)) <= AT_S + 0.65


@pytest.mark.parametrize(
    ("rate_m_s2", "within_s"), [(5.0, 0.3), (2.5, 0.5), (1.5, 0.8), (0.5, 1.1)]
)
@pytest.mark.parametrize("up", [False, True])
def test_a_slower_fly_away_from_hover_is_detected_later(
    rate_m_s2: float, within_s: float, up: bool
) -> None:
    def velocity(now_s: float) -> tuple[float, float, float]:
        speed = from_then_on(rate_m_s2, now_s)
        return (0.0, 0.0, -speed) if up else (speed, 0.0, 0.0)

    assert AT_S < detected_s(velocity) <= AT_S + within_s + 1e-6


@pytest.mark.parametrize("gust_m_s", [0.5, 1.0])
@pytest.mark.parametrize("rise_s", [0.05, 0.2, 0.3])
@pytest.mark.parametrize("forward_m_s", [0.0, 0.5])
def test_a_gust_is_no_fly_away(gust_m_s: float, rise_s: float, forward_m_s: float) -> None:
    def velocity(now_s: float) -> tuple[float, float, float]:
        pushed = min(1.0, max(0.0, now_s - AT_S) / rise_s) if now_s < AT_S + 3 else 0.0
        return forward_m_s + gust_m_s * pushed, 0.0, 0.0

    assert detected_s(velocity, lambda now_s: Setpoint(forward_m_s)) == math.inf


@pytest.mark.parametrize("left_s", [0.25, 0.5, 1.0, 2.0])
def test_the_lagging_response_to_a_setpoint_is_no_fly_away(left_s: float) -> None:
    """Setpoints start and stop every 3 s; the lags are the quickest and the slowest observed."""

    def asked(now_s: float) -> float:
        return 0.8 if now_s % 6 < 3 else 0.0

    answered = [0.0]
    while len(answered) < 401:
        last = answered[-1]
        answered.append(last + (asked(len(answered) * TICK_S - 0.3) - last) * TICK_S / left_s)
    watched = detected_s(
        lambda now_s: (1.1 * answered[round(now_s / TICK_S)], 0.0, 0.0),
        lambda now_s: Setpoint(asked(now_s)),
    )
    assert watched == math.inf


def test_a_requested_circle_is_no_fly_away() -> None:
    """The velocity lags half a second behind a heading that turns at 45 deg/s."""

    def velocity(now_s: float) -> tuple[float, float, float]:
        yaw = math.radians(45) * (now_s - 0.5)
        return 0.8 * math.cos(yaw), 0.8 * math.sin(yaw), 0.0

    circling = Setpoint(0.8, 0.0, 0.0, math.radians(45))
    yaw_rad = lambda now_s: math.radians(45) * now_s  # noqa: E731 - one line
    assert detected_s(velocity, lambda now_s: circling, yaw_rad) == math.inf


def test_no_fly_away_is_detected_while_the_autopilot_flies_by_itself() -> None:
    climb = lambda now_s: (0.0, 0.0, -1.24)  # noqa: E731 - one line
    assert detected_s(climb, lambda now_s: None) == math.inf


def test_the_end_of_a_take_off_is_no_fly_away() -> None:
    def velocity(now_s: float) -> tuple[float, float, float]:
        return 0.0, 0.0, -1.24 * math.exp(-max(0.0, now_s - AT_S) / 0.3)

    assert detected_s(velocity, lambda now_s: HOLD if now_s >= AT_S else None) == math.inf


def test_the_detection_lasts_as_long_as_the_fly_away() -> None:
    watch = UncommandedMotionWatch()
    for tick in range(200):
        now_s = tick * TICK_S
        speed = {True: 2.0, False: 0.0}[3.0 < now_s < 5.0]
        watch.take(Odometry(now_s, (0, 0, 0), (speed, 0, 0), 0.0))
        watch.ask(now_s, HOLD, 0.0)
        assert watch.has_flown_away == (3.0 < now_s < 5.0)

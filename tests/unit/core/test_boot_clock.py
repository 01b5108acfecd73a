"""Odometry with an autopilot's clock that drifts, steps or stops relative to ours."""

import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.messages import Odometry
from companion.drivers.autopilot_gyro import AutopilotGyro
from companion.link.odometry import OdometryReader
from tests.examples import examples

TICK_S = 0.05
SPEED_M_S, YAW_RATE_RAD_S = 0.5, math.radians(45)
SET_AT_S = 4.0
Report = tuple[float, Odometry]
"""True time, s, and the odometry reported at that time."""
BootOf = Callable[[float], float]
"""True time, s -> time of a clock, s."""


def reports(
    boot_of: BootOf, ours_of: BootOf, *, until_s: float = 10.0, late_s: float = 0.005, seed: int = 1
) -> Iterator[Report]:
    """Odometry of a drone that flies north and turns: positions at 20 Hz, attitudes at 25 Hz."""
    reader, random = OdometryReader(follows_us=False), Random(seed)
    sent: list[tuple[float, object]] = []
    for hz, is_attitude in ((20.0, False), (25.0, True)):
        for i in range(int(until_s * hz)):
            true_s = (i + 0.3) / hz
            boot_ms = round(1000 * boot_of(true_s))
            message = (
                attitude(boot_ms, YAW_RATE_RAD_S * true_s, YAW_RATE_RAD_S)
                if is_attitude
                else position(boot_ms, SPEED_M_S * true_s)
            )
            sent.append((true_s + random.uniform(0.0, late_s), message))
    sent.sort(key=lambda pair: pair[0])
    for tick in range(1, int(until_s / TICK_S)):
        true_s = tick * TICK_S
        odometry = None
        while sent and sent[0][0] <= true_s:
            _, message = sent.pop(0)
            odometry = reader.read(message, ours_of(true_s)) or odometry
        if odometry is not None:
            yield true_s, odometry


def position(boot_ms: int, north_m: float) -> object:
    return mavlink.MAVLink_local_position_ned_message(
        boot_ms, north_m, 0.0, -1.0, SPEED_M_S, 0.0, 0.0
    )


def attitude(boot_ms: int, yaw_rad: float, yaw_rate_rad_s: float) -> object:
    yaw_rad = math.remainder(yaw_rad, math.tau)
    return mavlink.MAVLink_attitude_message(boot_ms, 0.0, 0.0, yaw_rad, 0.0, 0.0, yaw_rate_rad_s)


def gaps_s(all_reports: list[Report]) -> list[float]:
    times_s = [true_s for true_s, _ in all_reports]
    return [b - a for a, b in pairwise(times_s)]


def position_error_m(report: Report) -> float:
    true_s, odometry = report
    return abs(odometry.position_ned_m[0] - SPEED_M_S * true_s)


def turn_error_rad(report: Report) -> float:
    true_s, odometry = report
    return abs(math.remainder(odometry.turned_rad - YAW_RATE_RAD_S * true_s, math.tau))


def ours(true_s: float) -> float:
    return 20.0 + true_s


@settings(deadline=None, max_examples=examples(60))
@given(st.floats(-3.0, 3.0), st.booleans(), st.integers(1, 1000))
def test_a_clock_step_leaves_no_gap_and_no_jump_in_the_odometry(
    step_s: float, is_ours: bool, seed: int
) -> None:
    """The autopilot's clock steps, or ours, which stops while the computer is paused."""

    def stepped(true_s: float) -> float:
        return 100.0 + true_s + (step_s if true_s > SET_AT_S else 0.0)

    clocks = (lambda true_s: 100.0 + true_s, stepped) if is_ours else (stepped, ours)
    all_reports = list(reports(*clocks, seed=seed))
    assert max(gaps_s(all_reports)) < 0.5
    assert max(map(position_error_m, all_reports)) < 0.12
    settled = [one for one in all_reports if not SET_AT_S < one[0] < SET_AT_S + 1.0]
    assert max(map(position_error_m, settled)) < 0.02
    assert max(map(turn_error_rad, settled)) < math.radians(2.5)


@pytest.mark.parametrize("ppm", [-1000, -300, 50, 300, 1000])
def test_the_odometry_follows_a_drifting_clock(ppm: float) -> None:
    all_reports = list(reports(lambda true_s: true_s * (1 + ppm * 1e-6), ours, until_s=120.0))
    assert max(gaps_s(all_reports)) < 0.11
    assert max(map(position_error_m, all_reports[10:])) < 0.01


def test_link_latency_is_not_mistaken_for_a_clock_step() -> None:
    all_reports = list(reports(lambda true_s: true_s, ours, until_s=60.0, late_s=0.3))
    assert max(gaps_s(all_reports[20:])) < 0.6
    assert max(map(position_error_m, all_reports[20:])) < 0.06


@given(st.floats(-3.0, 3.0))
def test_the_autopilots_gyro_samples_follow_a_clock_step(step_s: float) -> None:
    gyro, times_s = AutopilotGyro(), []
    for i in range(400):
        true_s = 0.02 * i
        boot_s = 100.0 + true_s + (step_s if true_s > SET_AT_S else 0.0)
        gyro.receive(mavlink.MAVLink_scaled_imu_message(round(1000 * boot_s), *(0,) * 9), true_s)
        for sample in gyro.read(true_s):
            assert sample.time_s <= true_s + 1e-9
            if not SET_AT_S < true_s < SET_AT_S + 0.6:
                assert sample.time_s > true_s - 0.06
            times_s.append(sample.time_s)
    assert times_s == sorted(set(times_s))
    assert max(b - a for a, b in pairwise(times_s)) < 0.65


@given(st.floats(-20.0, 20.0), st.integers(1, 60), st.floats(-90.0, 90.0))
def test_a_heading_correction_is_not_a_turn(pull_deg: float, steps: int, rate_deg_s: float) -> None:
    """A heading correction by the estimator, sudden or gradual, with and without a turn."""
    reader, rate_rad_s = OdometryReader(follows_us=False), math.radians(rate_deg_s)
    for i in range(120):
        time_s = 1.0 + 0.04 * i
        pulled_rad = math.radians(pull_deg) * min(max(i - 20, 0) / steps, 1.0)
        boot_ms = round(1000 * time_s)
        yaw_rad = rate_rad_s * time_s + pulled_rad
        reader.read(attitude(boot_ms, yaw_rad, rate_rad_s), time_s)
        odometry = reader.read(position(boot_ms, 0.0), time_s)
    assert odometry is not None
    turn_error_rad = math.remainder(odometry.turned_rad - rate_rad_s * time_s, math.tau)
    assert turn_error_rad == pytest.approx(0.0, abs=math.radians(0.1))
    assert math.remainder(odometry.yaw_rad - yaw_rad, math.tau) == pytest.approx(0.0, abs=1e-3)

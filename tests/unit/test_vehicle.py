"""The vehicle moves as ArduCopter was measured to move."""

import math
from random import Random

import pytest

from sitl.autopilot.core import PERSONALITIES
from sitl.autopilot.response import ARDUCOPTER, Shaper
from sitl.truth import TrueState
from sitl.vehicle import Gusts, Loop, Vehicle

STILL_AIR = Gusts(sigma_m_s=0.0)


def airborne() -> Vehicle:
    start = TrueState(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
    vehicle = Vehicle(start, Random(1), ARDUCOPTER.airframe, STILL_AIR)
    for _ in range(200):
        vehicle.step((0.0, 0.0, -1.0), 0.0)
    return vehicle


MEASURED: dict[tuple[str, str, float], tuple[dict[float, float], dict[float, float]]] = {
    ("ardupilot", "forward", 0.8): (
        {0.25: 0.09, 0.5: 0.43, 1: 0.88, 1.5: 0.95},
        {0.5: 0.63, 1: 0.17},
    ),
    ("ardupilot", "forward", 0.5): (
        {0.25: 0.12, 0.5: 0.49, 1: 0.90, 1.5: 0.94},
        {0.5: 0.54, 1: 0.13},
    ),
    ("ardupilot", "down", 0.4): (
        {0.25: 0.21, 0.5: 0.72, 1: 1.08, 1.5: 1.05},
        {0.5: 0.28, 1: -0.08},
    ),
    ("ardupilot", "yaw", 0.785): (
        {0.25: 0.39, 0.5: 1.09, 1: 1.09, 2: 1.01},
        {0.25: 0.63, 0.5: -0.09},
    ),
    ("px4", "forward", 0.8): ({0.25: 0.08, 0.5: 0.37, 1: 0.61, 2: 0.78}, {0.5: 0.45, 1: 0.18}),
    ("px4", "forward", 0.5): ({0.25: 0.06, 0.5: 0.35, 1: 0.59, 2: 0.72}, {0.5: 0.45, 1: 0.18}),
    ("px4", "yaw", 0.5): ({0.25: 0.26, 0.5: 0.68, 1: 0.89, 2: 0.95}, {0.25: 0.65, 0.5: 0.28}),
}
"""Share of a step reached so many seconds after it and after its end, on the real firmwares."""
HOLD_STEPS = 400


@pytest.mark.parametrize(("case", "shares"), MEASURED.items())
def test_steps_are_followed_as_the_real_firmware_follows_them(
    case: tuple[str, str, float], shares: tuple[dict[float, float], dict[float, float]]
) -> None:
    kind, axis, size = case
    response = PERSONALITIES[kind]().response
    shape = {"forward": response.horizontal, "down": response.vertical, "yaw": response.yaw}[axis]
    follow = {
        "forward": response.airframe.horizontal,
        "down": response.airframe.vertical,
        "yaw": response.airframe.yaw,
    }[axis]
    shaper, loop = Shaper(shape), Loop(follow)
    asked = [size] * HOLD_STEPS + [0.0] * 300
    share = [loop.step(shaper.step(value)) / size for value in asked]
    rises, falls = shares
    for after_s, measured in rises.items():
        assert share[round(100 * after_s) - 1] == pytest.approx(measured, rel=0.15, abs=0.06)
    for after_s, measured in falls.items():
        at = HOLD_STEPS + round(100 * after_s) - 1
        assert share[at] == pytest.approx(measured, rel=0.15, abs=0.06)


def test_it_tilts_into_its_acceleration_and_levels_out() -> None:
    vehicle = airborne()
    starting = vehicle.step((1.0, 0.0, 0.0), 0.0)
    assert starting.pitch_rad < -math.radians(5)
    for _ in range(1000):
        cruising = vehicle.step((1.0, 0.0, 0.0), 0.0)
    assert cruising.pitch_rad == pytest.approx(0, abs=math.radians(0.5))


def test_yaw_rate_is_limited() -> None:
    vehicle = airborne()
    for _ in range(200):
        state = vehicle.step((0.0, 0.0, 0.0), 10.0)
    assert math.degrees(state.yaw_rate_rad_s) == pytest.approx(90, abs=1)


def test_without_motors_it_falls_to_the_ground_and_stays() -> None:
    vehicle = airborne()
    for _ in range(300):
        state = vehicle.rest()
    assert state.position_ned_m[2] == 0
    assert state.velocity_ned_m_s == (0, 0, 0)


def test_gusts_move_it_a_little() -> None:
    start = TrueState(0.0, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
    vehicle = Vehicle(start, Random(1), ARDUCOPTER.airframe)
    speeds = []
    for _ in range(3000):
        vehicle._floor = 0.0
        speeds.append(vehicle.step((0.0, 0.0, 0.0), 0.0).velocity_ned_m_s[0])
    rms = math.sqrt(sum(speed**2 for speed in speeds) / len(speeds))
    assert 0.01 < rms < 0.06

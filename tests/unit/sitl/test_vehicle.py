"""Tests of the vehicle's motion against measurements of ArduCopter."""

import math
from random import Random

import pytest

from benchmarks.flight.autopilot_response import MEASURED, compared
from companion.safety.control_laws import turn_towards
from sitl.autopilot.response import ARDUCOPTER, PX4, Response, SetpointShaper
from sitl.core.truth import TrueState
from sitl.core.vehicle import Gusts, Vehicle

STILL_AIR = Gusts(sigma_m_s=0.0)
ON_GROUND = TrueState(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)


def airborne() -> Vehicle:
    vehicle = Vehicle(ON_GROUND, Random(1), ARDUCOPTER.airframe, STILL_AIR)
    for _ in range(200):
        vehicle.step((0.0, 0.0, -1.0), 0.0)
    return vehicle


@pytest.mark.parametrize("case", MEASURED)
def test_step_responses_match_the_real_firmware(
    case: tuple[str, str, float],
) -> None:
    for when, real, emulated in compared(*case):
        assert emulated == pytest.approx(real, rel=0.15, abs=0.06), when


@pytest.mark.parametrize("response", [ARDUCOPTER, PX4])
@pytest.mark.parametrize("heading_deg", [20, 90, 170])
def test_the_heading_settles_after_a_turn(response: Response, heading_deg: float) -> None:
    """The emulated ArduCopter once oscillated by 40° permanently; the real one comes to rest."""
    vehicle = Vehicle(ON_GROUND, Random(1), response.airframe, STILL_AIR)
    shaper = SetpointShaper(response)
    heading_rad, most_rad_s = math.radians(heading_deg), math.radians(45)
    state = vehicle.step((0.0, 0.0, -1.0), 0.0)
    for step in range(700):
        if step % 5 == 0:
            asked_rad_s = turn_towards(heading_rad, state.yaw_rad, most_rad_s)
        state = vehicle.step(*shaper.step((0.0, 0.0, -0.1), asked_rad_s))
    assert math.degrees(state.yaw_rad) == pytest.approx(heading_deg, abs=1)
    assert math.degrees(state.yaw_rate_rad_s) == pytest.approx(0, abs=1)


@pytest.mark.parametrize("response", [ARDUCOPTER, PX4])
def test_the_shaped_yaw_rate_overshoots_by_less_than_10_percent(response: Response) -> None:
    shaper = SetpointShaper(response)
    rates = [shaper.step((0.0, 0.0, 0.0), math.radians(90))[1] for _ in range(200)]
    assert math.degrees(max(rates)) < 1.1 * 90


def test_the_vehicle_pitches_while_it_accelerates_and_then_levels() -> None:
    vehicle = airborne()
    for _ in range(10):
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


def test_the_vehicle_falls_to_the_ground_without_motors() -> None:
    vehicle = airborne()
    for _ in range(300):
        state = vehicle.rest()
    assert state.position_ned_m[2] == 0
    assert state.velocity_ned_m_s == (0, 0, 0)


def test_gusts_cause_a_small_velocity() -> None:
    start = TrueState(0.0, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
    vehicle = Vehicle(start, Random(1), ARDUCOPTER.airframe)
    speeds = []
    for _ in range(3000):
        vehicle._floor = 0.0
        speeds.append(vehicle.step((0.0, 0.0, 0.0), 0.0).velocity_ned_m_s[0])
    rms = math.sqrt(sum(speed**2 for speed in speeds) / len(speeds))
    assert 0.01 < rms < 0.06

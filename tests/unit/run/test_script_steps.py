"""Tests the values that a script gives to its steps, and steps on the ground."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from companion import Drone, FlightEndedError, NotCompletedError, connect
from companion.pdps.flight.state import FlightState, Phase


@pytest.mark.parametrize(
    ("step", "why"),
    [
        (lambda drone: drone.fly_to(math.nan, 0.0), "north_m = nan: should be"),
        (lambda drone: drone.fly_to(1.0, 0.0, height_m=0.3), r"height_m = 0\.3: should be 0\.5"),
        (lambda drone: drone.fly_to(1.0, 0.0, yaw_rad=math.inf), "yaw_rad = inf: should be"),
        (lambda drone: drone.fly_to(1.0, 0.0, timeout_s=0.0), r"timeout_s = 0\.0: should be"),
        (lambda drone: drone.fly_velocity(0.8, 0.8), r"at most mission\.speed_m_s = 1\.0"),
        (lambda drone: drone.fly_velocity(down_m_s=-1.0), r"down_m_s = -1\.0: should be"),
        (lambda drone: drone.fly_velocity(0.1, yaw_rate_rad_s=2.0), r"mission\.turn_rate_deg_s"),
        (lambda drone: drone.fly_velocity(0.1, seconds=-1.0), r"seconds = -1\.0: should be"),
    ],
)
def test_a_value_out_of_its_limits_is_refused(step: Callable[[Drone], None], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        step(connect())


@pytest.mark.parametrize(
    ("step", "why"),
    [
        (
            lambda drone: drone.fly_to(5.0, 0.0),
            r"within 4\.6 m, inside mission\.max_distance_m = 5",
        ),
        (
            lambda drone: drone.fly_to(1.0, 0.0, height_m=1.9),
            r"height_m = 1\.9: should be 0\.5 to 1\.7, below mission\.max_height_m",
        ),
    ],
)
def test_a_target_beyond_the_fence_is_refused(step: Callable[[Drone], None], why: str) -> None:
    limits = {"mission.max_height_m": 2.0, "mission.max_distance_m": 5.0}
    with pytest.raises(ValueError, match=why):
        step(connect(settings=limits))


@pytest.mark.parametrize(
    "step",
    [
        Drone.scan_room,
        Drone.go_home,
        Drone.land,
        lambda drone: drone.fly_to(1.0, 0.0),
        lambda drone: drone.fly_velocity(0.1),
    ],
)
def test_a_step_on_the_ground_is_refused_instead_of_waiting(step: Callable[[Drone], None]) -> None:
    with pytest.raises(NotCompletedError, match=r"on the ground: take_off\(\) comes first"):
        step(connect())


@pytest.mark.parametrize(
    "step",
    [
        Drone.take_off,
        Drone.land,
        lambda drone: drone.fly_to(1.0, 0.0),
        lambda drone: drone.fly_velocity(0.1),
    ],
)
def test_a_step_after_the_pilot_took_over_says_so(step: Callable[[Drone], None]) -> None:
    drone = connect()
    drone._flight.app.flight = FlightState(Phase.HANDED_OVER, trouble="mode changed to LOITER")
    with pytest.raises(FlightEndedError, match="handed over: mode changed to LOITER"):
        step(drone)


def test_a_refused_velocity_that_no_call_waits_for_is_told_once_by_the_next() -> None:
    drone = connect()
    hovering = FlightState(Phase.HOVER, began_s=1.0)
    drone._flight.app.flight = hovering
    drone.fly_velocity(0.1)
    drone._flight.app.flight = replace(hovering, obeyed=1, undone="the velocity is refused")
    with pytest.raises(NotCompletedError, match="the velocity is refused"):
        drone.fly_velocity(0.1)
    drone.fly_velocity(0.1)

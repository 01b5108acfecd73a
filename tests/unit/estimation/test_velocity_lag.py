"""Estimation of the velocity lag from responses to earlier setpoints."""

from collections.abc import Sequence
from random import Random

import pytest

from companion.core.messages import FIRST_LAG_S, HOLD, Odometry, Setpoint
from companion.estimation.filters.velocity_lag import VelocityLag
from companion.safety.control_laws import approach_speed
from sitl.autopilot.response import ARDUCOPTER, PX4, Response, SetpointShaper
from sitl.core.truth import TrueState
from sitl.core.vehicle import STEP_S, Gusts, Vehicle

TICK_STEPS = 5


class Flown:
    """An emulated vehicle in still air with exact reported velocity."""

    def __init__(self, response: Response) -> None:
        start = TrueState(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
        self.lag = VelocityLag()
        self._shaper = SetpointShaper(response)
        self._vehicle = Vehicle(start, Random(1), response.airframe, Gusts(sigma_m_s=0.0))
        self._steps = 0
        for _ in range(300):  # lift off: the vehicle does not move on the ground
            self._vehicle.step((0.0, 0.0, -0.5), 0.0)

    def flies(self, setpoint: Setpoint, for_s: float) -> float:
        """Fly with a setpoint; returns the distance flown north, m."""
        began_m = self._vehicle.state.position_ned_m[0]
        for _ in range(round(for_s / (TICK_STEPS * STEP_S))):
            now_s = self._steps * STEP_S
            self.lag.ask(now_s, setpoint)
            for _ in range(TICK_STEPS):
                shaped = self._shaper.step((setpoint.forward_m_s, 0.0, 0.0), 0.0)
                state = self._vehicle.step(*shaped)
                self._steps += 1
            odometry = Odometry(
                self._steps * STEP_S, state.position_ned_m, state.velocity_ned_m_s, 0.0
            )
            self.lag.take(odometry)
        return self._vehicle.state.position_ned_m[0] - began_m


def legs(speeds_m_s: Sequence[float]) -> list[tuple[Setpoint, float]]:
    return [leg for speed in speeds_m_s for leg in ((Setpoint(speed), 4.0), (HOLD, 3.0))]


@pytest.mark.parametrize("speed_m_s", [0.4, 0.8])
def test_the_estimated_lag_predicts_the_stopping_distance(speed_m_s: float) -> None:
    for response, max_ratio in ((ARDUCOPTER, 1.25), (PX4, 1.6)):
        drone = Flown(response)
        for setpoint, for_s in legs((0.8, -0.8, 0.5, -0.5)):
            drone.flies(setpoint, for_s)
        drone.flies(Setpoint(speed_m_s), 4.0)
        coasted_m = drone.flies(HOLD, 5.0)
        assert 0.75 < drone.lag.lag_s * speed_m_s / coasted_m < max_ratio


def test_px4_has_a_longer_lag_than_arducopter() -> None:
    lags_s = []
    for response in (ARDUCOPTER, PX4):
        drone = Flown(response)
        for setpoint, for_s in legs((0.8, -0.8)):
            drone.flies(setpoint, for_s)
        lags_s.append(drone.lag.lag_s)
    assert lags_s[0] < lags_s[1]


def test_a_hover_does_not_change_the_lag() -> None:
    drone = Flown(PX4)
    drone.flies(HOLD, 60.0)
    assert drone.lag.lag_s == pytest.approx(FIRST_LAG_S)


def test_a_pause_of_the_setpoints_does_not_change_the_lag() -> None:
    drone = Flown(ARDUCOPTER)
    for setpoint, for_s in legs((0.8, -0.8)):
        drone.flies(setpoint, for_s)
    before_s = drone.lag.lag_s
    drone.lag.ask(100.0, None)
    drone.lag.take(Odometry(100.0, (0.0, 0.0, -1.0), (2.0, 0.0, 0.0), 0.0))
    drone.lag.ask(130.0, HOLD)
    drone.lag.take(Odometry(130.0, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), 0.0))
    assert drone.lag.lag_s == before_s


@pytest.mark.parametrize("lag_s", [0.3, 0.75, 1.3])
def test_the_drone_can_stop_from_the_approach_speed_within_its_clearance(lag_s: float) -> None:
    for room_m in (0.1, 0.5, 2.0, 5.0):
        speed_m_s = approach_speed(room_m, 10.0, lag_s)
        assert speed_m_s * lag_s + speed_m_s**2 / (2 * 0.5) == pytest.approx(room_m)

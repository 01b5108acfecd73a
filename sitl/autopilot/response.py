"""Models a firmware's setpoint shaping and its vehicle's response, axis by axis.

setpoint ─► Shaper: bounded acceleration and jerk ─► vehicle.Loop: lag and slow tail ─► velocity

The parameters are fitted to step responses of the real firmware in its own simulation.
docs/autopilot.md compares both; `python -m benchmarks.flight.autopilot_response` prints the
comparison.
"""

import math
from dataclasses import dataclass

from companion.core.frames import Vector3
from sitl.autopilot.estimation.velocity_error import EstimateErrors
from sitl.core.vehicle import STEP_S, Airframe, Follow


@dataclass(frozen=True, slots=True)
class Shape:
    """Bounds of one axis; units are m or rad."""

    time_constant_s: float
    """Time constant from velocity error to commanded acceleration, s."""
    max_acceleration: float
    """Units per s²."""
    max_jerk: float
    """Units per s³."""


@dataclass(frozen=True, slots=True)
class Response:
    """Parameters of all axes of one firmware and its vehicle."""

    horizontal: Shape
    vertical: Shape
    yaw: Shape
    airframe: Airframe
    take_off_delay_s: float
    """Shortest time from an accepted take-off to the first motion, s."""
    spool_up_s: float
    """Time from arming to lift-off thrust, s."""
    take_off_m_s: float
    """Peak climb rate of NAV_TAKEOFF, m/s."""
    take_off_gain_1_s: float
    """Climb rate per remaining height near the take-off height, 1/s."""
    estimate: EstimateErrors
    land_m_s: float
    land_drift_m_s: float
    """Horizontal speed during a landing, by the estimate: standard deviation per axis, m/s."""
    disarm_delay_s: float
    """Time from touchdown to disarming after a landing, s."""


ARDUCOPTER = Response(
    horizontal=Shape(0.024, 2.86, 60.0),
    vertical=Shape(0.039, 5.3, 60.0),
    yaw=Shape(0.03, 27.0, 238.0),
    airframe=Airframe(
        horizontal=Follow(4.4, 0.65, 0.32, 0.84),
        vertical=Follow(4.2, 0.61, 0.0, 1.0),
        yaw=Follow(5.4, 0.43, 0.0, 1.0),
    ),
    take_off_delay_s=1.0,
    spool_up_s=3.3,
    take_off_m_s=1.15,
    take_off_gain_1_s=1.2,
    estimate=EstimateErrors(0.01, 0.01, 0.005, math.radians(3.0)),
    land_m_s=0.54,
    land_drift_m_s=0.03,
    disarm_delay_s=2.5,
)
"""ArduCopter 4.6.3, quad; fitted to its own SITL."""
PX4 = Response(
    horizontal=Shape(0.245, 4.9, 58.0),
    vertical=Shape(0.052, 1.17, 38.5),
    yaw=Shape(0.036, 14.6, 147.0),
    airframe=Airframe(
        horizontal=Follow(6.3, 0.98, 0.30, 5.9),
        vertical=Follow(40.0, 0.45, 0.19, 1.2),
        yaw=Follow(5.57, 0.79, 0.14, 1.6),
    ),
    take_off_delay_s=0.0,
    spool_up_s=3.2,
    take_off_m_s=1.5,
    take_off_gain_1_s=1.0,
    estimate=EstimateErrors(0.06, 0.07, 0.06, math.radians(10.0)),
    land_m_s=0.6,
    land_drift_m_s=0.07,
    disarm_delay_s=5.5,
)
"""PX4 1.17.0-beta1, quad; fitted to SIH."""


class Shaper:
    """One axis: a velocity setpoint with bounded acceleration and jerk."""

    def __init__(self, shape: Shape) -> None:
        self._shape = shape
        self._acceleration = 0.0
        self.velocity = 0.0

    def reset(self) -> None:
        self.velocity = self._acceleration = 0.0

    def step(self, wanted: float) -> float:
        """Advance by one time step towards the wanted velocity.

        The acceleration stays small enough for the jerk limit to remove it before the velocity is
        reached. A firmware does not overshoot its own reference.
        """
        s = self._shape
        error = wanted - self.velocity
        to_stop = math.sqrt(2 * s.max_jerk * abs(error))
        most = min(abs(error) / s.time_constant_s, to_stop, s.max_acceleration)
        acceleration = math.copysign(most, error)
        self._acceleration += _within(acceleration - self._acceleration, s.max_jerk * STEP_S)
        self.velocity += self._acceleration * STEP_S
        return self.velocity


class SetpointShaper:
    """Shapes the setpoints of all axes."""

    def __init__(self, response: Response) -> None:
        self._north, self._east = Shaper(response.horizontal), Shaper(response.horizontal)
        self._down, self._yaw = Shaper(response.vertical), Shaper(response.yaw)

    def reset(self) -> None:
        for axis in (self._north, self._east, self._down, self._yaw):
            axis.reset()

    def step(self, velocity_ned_m_s: Vector3, yaw_rate_rad_s: float) -> tuple[Vector3, float]:
        """Advance by one time step towards the setpoint."""
        north, east, down = velocity_ned_m_s
        shaped = self._north.step(north), self._east.step(east), self._down.step(down)
        return shaped, self._yaw.step(yaw_rate_rad_s)


def _within(value: float, bound: float) -> float:
    return max(-bound, min(bound, value))

"""Estimates the lag of the drone's velocity response in flight.

    commanded velocity ─► bank of first-order lags ─► predicted velocities ◄─► reported velocity

The lag with the least squared prediction error is used. Only changes of the velocity carry
information. With a first-order lag τ, a drone that is stopped at speed v travels a further v·τ.
"""

import math

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import frd_to_ned
from companion.core.messages import FIRST_LAG_S, Odometry, Setpoint

_LAGS_S: Array = np.array([0.3, 0.45, 0.6, 0.75, 0.9, 1.1, 1.3])
"""Candidate lags, s. Chosen."""
_MEMORY_S = 30.0
"""Time constant of the error average, in seconds of changing velocity. Chosen."""
_FIRST_COST = 0.05
"""Prior cost, m²/s: equals five seconds of a wrong lag when the velocity changes by 0.3 m/s.
Chosen."""
_MIN_SPREAD_M_S = 0.05
"""Least difference between the predictions of the shortest and the longest lag, m/s. Chosen."""
_GAP_S = 0.5
"""A longer gap between setpoints or messages restarts the prediction, s. Chosen."""


class VelocityLag:
    """Velocity lag of one drone. Time is an argument."""

    def __init__(self) -> None:
        self._predicted: Array = np.zeros((len(_LAGS_S), 2))
        self._costs = _FIRST_COST * np.log(_LAGS_S / FIRST_LAG_S) ** 2
        self._commanded_s = -math.inf
        self._odometry_s = -math.inf
        self._yaw_rad = 0.0

    @property
    def lag_s(self) -> float:
        return float(_LAGS_S[self._costs.argmin()])

    def ask(self, now_s: float, setpoint: Setpoint | None) -> None:
        """The setpoint sent at this tick; None if none is sent."""
        dt_s, self._commanded_s = now_s - self._commanded_s, now_s
        if setpoint is None or dt_s > _GAP_S:
            self._odometry_s = -math.inf
            self._commanded_s = -math.inf if setpoint is None else now_s
            return
        commanded = np.array(frd_to_ned(setpoint.forward_m_s, setpoint.right_m_s, self._yaw_rad))
        response = 1 - np.exp(-dt_s / _LAGS_S)
        self._predicted += response[:, None] * (commanded - self._predicted)

    def take(self, odometry: Odometry) -> None:
        """Compare the predictions with the autopilot's reported velocity."""
        velocity_m_s, self._yaw_rad = np.array(odometry.velocity_ned_m_s[:2]), odometry.yaw_rad
        dt_s, self._odometry_s = odometry.time_s - self._odometry_s, odometry.time_s
        if not 0 < dt_s < _GAP_S:
            self._predicted[:] = velocity_m_s
            return
        if np.hypot(*(self._predicted[0] - self._predicted[-1])) < _MIN_SPREAD_M_S:
            return
        error_m2_s2 = ((velocity_m_s - self._predicted) ** 2).sum(axis=1)
        self._costs += dt_s * (error_m2_s2 - self._costs / _MEMORY_S)

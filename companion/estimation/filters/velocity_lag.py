"""How late the drone follows a velocity, learnt in flight: how far it goes on after it was stopped.

    asked velocity ─► first-order lags, a bank of them ─► predicted velocities ◄─► told velocity

The lag that has predicted the told velocity best is taken. Only changes of the velocity tell of it.
A first-order lag τ lets a drone that is stopped at v come to rest after v·τ.
"""

import math

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import frd_to_ned
from companion.core.messages import FIRST_LAG_S, Odometry, Setpoint

Array = NDArray[np.float64]

_LAGS_S: Array = np.array([0.3, 0.45, 0.6, 0.75, 0.9, 1.1, 1.3])
_MEMORY_S = 30.0
"""Of changing velocity, after which what was seen counts a third."""
_FIRST_COST = 0.05
"""m²/s: as much as five seconds of a wrong lag cost when the velocity changes by 0.3 m/s."""
_TELLS_M_S = 0.05
"""The quickest and the slowest lag must differ by so much."""
_GAP_S = 0.5
"""Farther apart, setpoints are no stream."""


class VelocityLag:
    """Of one drone; time is an argument."""

    def __init__(self) -> None:
        self._predicted: Array = np.zeros((len(_LAGS_S), 2))
        self._costs = _FIRST_COST * np.log(_LAGS_S / FIRST_LAG_S) ** 2
        self._asked_s = -math.inf
        self._odometry_s = -math.inf
        self._yaw_rad = 0.0

    @property
    def lag_s(self) -> float:
        return float(_LAGS_S[self._costs.argmin()])

    def ask(self, now_s: float, setpoint: Setpoint | None) -> None:
        """What goes out at this tick; None: nothing, the autopilot flies as it sees fit."""
        dt_s, self._asked_s = now_s - self._asked_s, now_s
        if setpoint is None or dt_s > _GAP_S:
            self._odometry_s = -math.inf
            self._asked_s = -math.inf if setpoint is None else now_s
            return
        asked = np.array(frd_to_ned(setpoint.forward_m_s, setpoint.right_m_s, self._yaw_rad))
        answered = 1 - np.exp(-dt_s / _LAGS_S)
        self._predicted += answered[:, None] * (asked - self._predicted)

    def take(self, odometry: Odometry) -> None:
        """What the autopilot tells of its velocity."""
        velocity_m_s, self._yaw_rad = np.array(odometry.velocity_ned_m_s[:2]), odometry.yaw_rad
        dt_s, self._odometry_s = odometry.time_s - self._odometry_s, odometry.time_s
        if not 0 < dt_s < _GAP_S:
            self._predicted[:] = velocity_m_s
            return
        if np.hypot(*(self._predicted[0] - self._predicted[-1])) < _TELLS_M_S:
            return
        off = ((velocity_m_s - self._predicted) ** 2).sum(axis=1)
        self._costs += dt_s * (off - self._costs / _MEMORY_S)

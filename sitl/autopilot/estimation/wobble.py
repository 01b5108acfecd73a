"""What a firmware adds to its sensors' errors: in its estimate, and in following its setpoints.

Both velocity errors are correlated, and bounded, as the estimate follows its position source:

    w' = u,   u' = -u/τ - ω²·w + noise

u is the velocity error, w the position error that it comes to. Measured on PX4 1.17 with ODOMETRY
as its source, in twelve flights: over 0.25 to 2 s told motion is off by 0.06 to 0.03 m/s, told
velocity by 0.09 to 0.065 m/s (0.06 to 0.04 with the noise in `external/px4.parm`), mostly
independently.
"""

import math
from dataclasses import dataclass
from random import Random


@dataclass(frozen=True, slots=True)
class EstimateError:
    """Sigmas, in the air."""

    velocity_m_s: float = 0.0
    """On each level axis, correlated over a second. The control loop does not follow it: what is
    told errs by it independently of the true motion."""
    sway_m_s: float = 0.0
    """So much the true velocity is off what was asked for, likewise. The estimated velocity does
    not know of it, which the control loop follows; the estimated position does."""
    climb_m_s: float = 0.0
    """Correlated over half a second."""
    take_off_heading_rad: float = 0.0
    """By how much the heading moves after lift-off."""


NO_ERROR = EstimateError()
KICK_S = 0.1
"""The noise is drawn so often."""


class Wobble:
    """One axis."""

    def __init__(
        self, random: Random, sigma_m_s: float, time_constant_s: float, swing_rad_s: float
    ) -> None:
        self._random = random
        self._time_constant_s = time_constant_s
        self._stiffness = swing_rad_s**2
        self._kick = sigma_m_s * math.sqrt(2 * KICK_S / time_constant_s)
        self.position_m = 0.0
        self.velocity_m_s = 0.0

    def kick(self) -> None:
        """Once every `KICK_S`."""
        self.velocity_m_s += self._random.gauss(0, self._kick)

    def step(self, dt_s: float) -> None:
        u = self.velocity_m_s
        u -= (u / self._time_constant_s + self._stiffness * self.position_m) * dt_s
        self.position_m += u * dt_s
        self.velocity_m_s = u

"""Models errors that a firmware adds to its sensors' errors, in estimate and control.

Both velocity errors are correlated and bounded, because the estimate follows its position source:

    w' = u,   u' = -u/τ - ω²·w + noise

u is the velocity error, w the resulting position error. Measured on PX4 1.17 with ODOMETRY as its
source, in twelve flights: over 0.25 to 2 s the reported motion errs by 0.06 to 0.03 m/s. The
reported velocity errs by 0.09 to 0.065 m/s (0.06 to 0.04 with the noise in `external/px4.parm`).
The two errors are mostly independent.
"""

import math
from dataclasses import dataclass
from random import Random


@dataclass(frozen=True, slots=True)
class EstimateErrors:
    """Standard deviations in the air."""

    velocity_m_s: float = 0.0
    """Per horizontal axis, correlated over a second. The control loop does not follow it: the
    reported velocity errs independently of the true motion."""
    sway_m_s: float = 0.0
    """Difference between true and commanded velocity, likewise correlated. The estimated velocity,
    which the control loop follows, does not contain it; the estimated position does."""
    climb_m_s: float = 0.0
    """Vertical, correlated over half a second."""
    take_off_heading_rad: float = 0.0
    """Change of the heading after lift-off."""


NO_ERROR = EstimateErrors()
KICK_S = 0.1
"""Time between two draws of the noise, s."""


class VelocityError:
    """The error of one axis."""

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
        """Draw the noise; call once every `KICK_S`."""
        self.velocity_m_s += self._random.gauss(0, self._kick)

    def step(self, dt_s: float) -> None:
        u = self.velocity_m_s
        u -= (u / self._time_constant_s + self._stiffness * self.position_m) * dt_s
        self.position_m += u * dt_s
        self.velocity_m_s = u

"""Models the drift of the frame that only odometry moves."""

import numpy as np

from companion.core.arrays import Array
from companion.core.values import value

DRIFT_SIGMAS = 2.0
"""Limit of the drone's drift in sigmas: 19 of 20 cases on either axis."""


@value
class Drift:
    """Error model of odometry."""

    walk_m2_per_s: float = 0.0
    """Random walk of the position on each axis, m²/s."""
    wander_m: float = 0.0
    """Sigma of a bounded position error that varies slowly, m."""

    def sigma_m(self, age_s: Array) -> Array:
        """Sigma of the drift on each axis after `age_s` (n,): (n,), m."""
        wandered_m2 = np.where(age_s > 0, 2 * self.wander_m**2, 0.0)
        sigma_m: Array = np.sqrt(self.walk_m2_per_s * age_s + wandered_m2)
        return sigma_m


NO_DRIFT = Drift()

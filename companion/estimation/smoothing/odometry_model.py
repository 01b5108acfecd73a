"""Models the errors of the autopilot's odometry: a random walk and a bounded, correlated wander.

    displacement + w(t₂) - w(t₁) = (1 + s)·reported + walk
    dw = -w/τ·dt + noise,   stationary sigma σ_w

The scale s is estimated with the reported displacement, averaged over some seconds, as instrument:
Σ mean(reported)·residual = 0. The unaveraged displacement would bias s towards zero: it has noise,
and an autopilot that follows its estimate moves the drone against the estimate's error. The average
contains the legs, which determine the scale, and little of both errors.

An autopilot's estimate follows its position source, so its error is bounded. Wheel or flow odometry
walks and hardly wanders.
"""

from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array

WANDER_S = 0.8
"""Correlation time of an autopilot's position error, s. Measured: 0.7 to 1 s on PX4 1.17, in
hover."""
AVERAGED_S = 4.0
"""Averaging time of the reported motion, s: several correlation times of the wander, half a leg.
Chosen: results of 2 to 10 s differ by less than 0.4 % of the size of recorded rooms."""
MIN_WANDER_M = 0.002
"""Least sigma of the wander, m. Chosen: it keeps the equations solvable."""
MIN_STEP_M = 1e-4
"""Least sigma of a step of the wander, m. Chosen: it keeps the equations solvable."""


@dataclass(slots=True)
class OdometryModel:
    """Noise of the odometry. The wander is estimated in flight."""

    scale_sigma: float = 0.05
    step_variance_m2_per_s: float = 0.005**2 / 0.1
    """Random walk on each axis: 5 mm a step at 10 Hz."""
    floor_m: float = 0.002
    """Error of a step by rounding and message timing, m; in the worst case equal at each step."""
    wander_m: float = MIN_WANDER_M
    """σ_w on each axis (`odometry_noise.py`), m."""

    def step_sigma_m(self, dt_s: Array) -> Array:
        """Sigma of the walk on one axis over steps of `dt_s`, (n,)."""
        sigma_m: Array = np.sqrt(self.step_variance_m2_per_s * dt_s) + self.floor_m
        return sigma_m

    def wander_step_sigma_m(self, dt_s: Array) -> Array:
        """Sigma of the wander's change beyond its decay, (n,)."""
        sigma_m: Array = self.wander_m * np.sqrt(1 - wander_kept(dt_s) ** 2) + MIN_STEP_M
        return sigma_m


def averaged(dt_s: Array, moved_frd_m: Array, turned_rad: Array) -> Array:
    """(n, 2): displacements in steps of `dt_s` (n,), by the mean velocity around each step.

    `moved_frd_m` (n, 2) and `turned_rad` (n,) are the reported motions. The result is in the same
    frames: the body frame before each step.
    """
    level = np.exp(1j * (np.cumsum(turned_rad) - turned_rad))
    moved = (moved_frd_m[:, 0] + 1j * moved_frd_m[:, 1]) * level
    place, time_s = (np.concatenate([[0], np.cumsum(steps)]) for steps in (moved, dt_s))
    half_s = np.maximum(AVERAGED_S, dt_s) / 2
    middle_s = time_s[1:] - dt_s / 2
    ahead = np.interp(middle_s + half_s, time_s, place)
    behind = np.interp(middle_s - half_s, time_s, place)
    mean = (ahead - behind) * dt_s / (2 * half_s) / level
    return np.column_stack([mean.real, mean.imag])


def wander_kept(dt_s: Array) -> Array:
    """Share of the wander that remains after `dt_s`."""
    kept: Array = np.exp(-np.asarray(dt_s) / WANDER_S)
    return kept

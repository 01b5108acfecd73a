"""How the autopilot's odometry errs: by a random walk, and by a bounded, correlated wander.

    told = displacement / (1 + s) + w(t₂) - w(t₁) + walk
    dw = -w/τ·dt + noise,   stationary sigma σ_w

What errs is the told side: with the scale on that side instead, (1 + s)·told, its noise would make
the least squares' s too small, as any regression on a noisy variable does.

An autopilot's estimate follows its position source, so that its error does not grow. Wheel or flow
odometry walks and hardly wanders.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WANDER_S = 0.8
"""Correlation time of an autopilot's position error: 0.7 to 1 s on PX4 1.17, in hover."""
LEAST_WANDER_M = 0.002
"""What never errs less than this keeps the equations solvable."""
LEAST_STEP_M = 1e-4


@dataclass(slots=True)
class OdometryModel:
    """How far odometry may be trusted; how far it wanders is learnt in flight."""

    scale_sigma: float = 0.05
    step_variance_m2_per_s: float = 0.005**2 / 0.1
    """Random walk on each axis: 5 mm a step at 10 Hz."""
    floor_m: float = 0.002
    """What rounding and the messages' timing add to a step, at worst the same way each time."""
    wander_m: float = LEAST_WANDER_M
    """σ_w, on each axis (`odometry_noise.py`)."""

    def step_sigma_m(self, dt_s: Array) -> Array:
        """Of the walk on one axis over steps that took so long, (n,)."""
        sigma_m: Array = np.sqrt(self.step_variance_m2_per_s * dt_s) + self.floor_m
        return sigma_m

    def wander_step_sigma_m(self, dt_s: Array) -> Array:
        """By how much the wander's change differs from its fading, (n,)."""
        sigma_m: Array = self.wander_m * np.sqrt(1 - wander_kept(dt_s) ** 2) + LEAST_STEP_M
        return sigma_m


def wander_kept(dt_s: Array) -> Array:
    """What share of the wander is left after so long."""
    kept: Array = np.exp(-np.asarray(dt_s) / WANDER_S)
    return kept

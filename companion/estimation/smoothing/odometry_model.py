"""How the autopilot's odometry errs: by a random walk, and by a bounded, correlated wander.

    displacement + w(t₂) - w(t₁) = (1 + s)·told + walk
    dw = -w/τ·dt + noise,   stationary sigma σ_w

The scale s is solved for with the told displacement averaged over the time around as instrument:
Σ mean(told)·residual = 0. The displacement of the moment would make it too small: it has noise,
and an autopilot that follows its estimate moves the drone against the estimate's error. The mean
keeps the legs, of which the scale tells, and little of both.

An autopilot's estimate follows its position source, so that its error does not grow. Wheel or flow
odometry walks and hardly wanders.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WANDER_S = 0.8
"""Correlation time of an autopilot's position error: 0.7 to 1 s on PX4 1.17, in hover."""
AVERAGED_S = 4.0
"""Time over which the told motion is averaged: several correlation times of the wander, half a leg.
Chosen: 2 to 10 s differ by less than 0.4 % of the size of recorded rooms."""
MIN_WANDER_M = 0.002
"""What never errs less than this keeps the equations solvable."""
MIN_STEP_M = 1e-4


@dataclass(slots=True)
class OdometryModel:
    """How far odometry may be trusted; how far it wanders is learnt in flight."""

    scale_sigma: float = 0.05
    step_variance_m2_per_s: float = 0.005**2 / 0.1
    """Random walk on each axis: 5 mm a step at 10 Hz."""
    floor_m: float = 0.002
    """What rounding and the messages' timing add to a step, at worst the same way each time."""
    wander_m: float = MIN_WANDER_M
    """σ_w, on each axis (`odometry_noise.py`)."""

    def step_sigma_m(self, dt_s: Array) -> Array:
        """Of the walk on one axis over steps that took so long, (n,)."""
        sigma_m: Array = np.sqrt(self.step_variance_m2_per_s * dt_s) + self.floor_m
        return sigma_m

    def wander_step_sigma_m(self, dt_s: Array) -> Array:
        """By how much the wander's change differs from its fading, (n,)."""
        sigma_m: Array = self.wander_m * np.sqrt(1 - wander_kept(dt_s) ** 2) + MIN_STEP_M
        return sigma_m


def averaged(dt_s: Array, moved_frd_m: Array, turned_rad: Array) -> Array:
    """(n, 2): steps that took `dt_s` (n,), each by the mean velocity of the time around it.

    `moved_frd_m` (n, 2) and `turned_rad` (n,) are told of the steps; the result is in the same
    frames, the body's before each step.
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
    """What share of the wander is left after so long."""
    kept: Array = np.exp(-np.asarray(dt_s) / WANDER_S)
    return kept

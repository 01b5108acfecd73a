"""How our gyro's bias has moved, as the autopilot's gyro tells, which is the steadier one.

Both turn with the body. How far ours is ahead of the autopilot's, e, grows with the difference of
their biases, d, and of their scales, κ:

own        e_{k+1} - e_k - d_k·dt
bias       d_{k+1} - d_k
told       e_k + κ·T_k - (G_k - T_k)        G, T: turned by ours and by the autopilot's, uncorrected

The autopilot's bias wanders several times more slowly than ours, so d moves as ours does. What it
tells comes late by some milliseconds; over ten seconds that is averaged out. Where a compass sets
its heading, it does not go as a gyro can, and counts for nothing.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.estimation.filters.heading_filter import GyroModel
from companion.estimation.smoothing.bordered_solver import BorderedSystem, cauchy
from companion.estimation.smoothing.state import Array, Measured

ROUNDS = 3
MAX_RMS = 2.0
"""In sigmas of what was told: with more it does not go as a gyro would."""
MIN_KEYFRAMES = 20
_SIZE = 2
"""Unknowns of a keyframe: e and d."""


@dataclass(frozen=True, slots=True)
class AutopilotGyroModel:
    """How far the heading may be trusted that the autopilot tells."""

    bias_walk_rad_s_sqrt_s: float = math.radians(0.002)
    """Of its gyro, which is warm and in a better package than ours."""
    bias_sigma_rad_s: float = math.radians(0.2)
    scale_sigma: float = 0.03
    """Of the difference of both."""
    sigma_rad: float = math.radians(0.3)
    """Of one heading that was told: it comes late, and more so as it goes on."""


def steadied(m: Measured, gyro: GyroModel, told: AutopilotGyroModel) -> Measured:
    """With how our gyro's bias has moved, where the autopilot's can tell."""
    at = np.flatnonzero(np.isfinite(m.autopilot_yaw_rad))
    if len(at) < MIN_KEYFRAMES:
        return m
    first, last = int(at[0]), int(at[-1])
    moved_rad_s = _bias_moved(m.between(first, last + 1), gyro, told)
    if moved_rad_s is None:
        return m
    bias_moved_rad_s, is_steadied = m.bias_moved_rad_s.copy(), m.is_steadied.copy()
    bias_moved_rad_s[first:last], is_steadied[first:last] = moved_rad_s, True
    return replace(m, bias_moved_rad_s=bias_moved_rad_s, is_steadied=is_steadied)


def _bias_moved(m: Measured, gyro: GyroModel, told: AutopilotGyroModel) -> Array | None:
    """(k - 1,): by so much from each keyframe to the next, rad/s; None if it cannot be told."""
    autopilot_yaw_rad = m.autopilot_yaw_rad - m.autopilot_yaw_rad[0]
    used = np.flatnonzero(np.isfinite(autopilot_yaw_rad))
    autopilot_yaw_rad = autopilot_yaw_rad[used]
    ahead_rad = np.concatenate([[0.0], np.cumsum(m.turned_rad)])[used] - autopilot_yaw_rad
    x, scale, off_rad = np.zeros((len(m.autopilot_yaw_rad), _SIZE)), 0.0, -ahead_rad
    for _ in range(ROUNDS):
        system = _alone(x, scale, m, gyro, told)
        system.add(
            off_rad,
            told.sigma_rad * cauchy(off_rad / told.sigma_rad),
            [(_SIZE * used, np.ones(len(used)))],
            [(0, autopilot_yaw_rad)],
        )
        solution = system.solve()
        x += solution.chained.reshape(-1, _SIZE)
        scale += float(solution.shared[0])
        off_rad = x[used, 0] + scale * autopilot_yaw_rad - ahead_rad
    if np.sqrt(np.mean(off_rad**2)) > MAX_RMS * told.sigma_rad:
        return None
    moved_rad_s: Array = np.diff(x[:, 1])
    return moved_rad_s


def _alone(
    x: Array, scale: float, m: Measured, gyro: GyroModel, told: AutopilotGyroModel
) -> BorderedSystem:
    """What is known of the gyros before the autopilot tells; `x`: (k, 2), e and d."""
    at = _SIZE * np.arange(len(x) - 1)
    one = np.ones(len(at))
    system = BorderedSystem(x.size, 1, 2 * _SIZE)
    system.add(
        x[1:, 0] - x[:-1, 0] - x[:-1, 1] * m.dt_s,
        gyro.turn_sigma_rad(m.dt_s, m.gap_rad2),
        [(at, -one), (at + 1, -m.dt_s), (at + _SIZE, one)],
    )
    system.add(
        x[1:, 1] - x[:-1, 1],
        np.sqrt(gyro.bias_variance_per_s(m.age_s) * m.dt_s),
        [(at + 1, -one), (at + _SIZE + 1, one)],
    )
    first = np.array([0, 1])
    sigma = np.array([told.sigma_rad, told.bias_sigma_rad_s])
    system.add(x[0], sigma, [(first, np.ones(2))])
    system.add(np.array([scale]), told.scale_sigma, [], [(0, np.ones(1))])
    return system

"""Estimates the change of our gyro's bias, with the more stable autopilot gyro as reference.

Both gyros turn with the body. Our turn less the autopilot's, e, grows with the differences of
their biases, d, and of their scales, κ:

own        e_{k+1} - e_k - d_k·dt
bias       d_{k+1} - d_k
reported   e_k + κ·T_k - (G_k - T_k)        G, T: turn by our and by the autopilot's gyro, raw

The autopilot's bias wanders several times more slowly than ours, so the change of d is that of our
bias. The reported heading is late by some milliseconds, which averages out over ten seconds. A
heading that is reset by a compass does not follow a gyro's model and is not used.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.core.arrays import Array
from companion.estimation.filters.heading_filter import GyroModel
from companion.estimation.smoothing.bordered_solver import BorderedSystem, cauchy
from companion.estimation.smoothing.state import Measured

ROUNDS = 3
"""Rounds of robust least squares. Chosen."""
MAX_RMS = 2.0
"""Largest RMS residual in sigmas; with a larger one the heading does not follow a gyro. Chosen."""
MIN_KEYFRAMES = 20
"""Least keyframes with a reported heading. Chosen."""
_SIZE = 2
"""Unknowns of a keyframe: e and d."""


@dataclass(frozen=True, slots=True)
class AutopilotGyroModel:
    """Noise of the heading that the autopilot reports."""

    bias_walk_rad_s_sqrt_s: float = math.radians(0.002)
    """Random walk of its bias: it is warm and better mounted than ours."""
    bias_sigma_rad_s: float = math.radians(0.2)
    scale_sigma: float = 0.03
    """Sigma of the difference of both scales."""
    sigma_rad: float = math.radians(0.3)
    """Sigma of one reported heading: its latency varies."""


def aided(m: Measured, gyro: GyroModel, autopilot_gyro: AutopilotGyroModel) -> Measured:
    """Determine the change of our gyro's bias where the autopilot reports its heading."""
    at = np.flatnonzero(np.isfinite(m.autopilot_yaw_rad))
    if len(at) < MIN_KEYFRAMES:
        return m
    first, last = int(at[0]), int(at[-1])
    moved_rad_s = _bias_moved(m.between(first, last + 1), gyro, autopilot_gyro)
    if moved_rad_s is None:
        return m
    bias_moved_rad_s, is_aided = m.bias_moved_rad_s.copy(), m.is_aided.copy()
    bias_moved_rad_s[first:last], is_aided[first:last] = moved_rad_s, True
    return replace(m, bias_moved_rad_s=bias_moved_rad_s, is_aided=is_aided)


def _bias_moved(m: Measured, gyro: GyroModel, autopilot_gyro: AutopilotGyroModel) -> Array | None:
    """(k - 1,): change between keyframes, rad/s; None if the heading does not follow a gyro."""
    autopilot_yaw_rad = m.autopilot_yaw_rad - m.autopilot_yaw_rad[0]
    used = np.flatnonzero(np.isfinite(autopilot_yaw_rad))
    autopilot_yaw_rad = autopilot_yaw_rad[used]
    ahead_rad = np.concatenate([[0.0], np.cumsum(m.turned_rad)])[used] - autopilot_yaw_rad
    x, scale, residual_rad = np.zeros((len(m.autopilot_yaw_rad), _SIZE)), 0.0, -ahead_rad
    for _ in range(ROUNDS):
        system = _without_reports(x, scale, m, gyro, autopilot_gyro)
        system.add(
            residual_rad,
            autopilot_gyro.sigma_rad * cauchy(residual_rad / autopilot_gyro.sigma_rad),
            [(_SIZE * used, np.ones(len(used)))],
            [(0, autopilot_yaw_rad)],
        )
        solution = system.solve()
        x += solution.chained.reshape(-1, _SIZE)
        scale += float(solution.shared[0])
        residual_rad = x[used, 0] + scale * autopilot_yaw_rad - ahead_rad
    if np.sqrt(np.mean(residual_rad**2)) > MAX_RMS * autopilot_gyro.sigma_rad:
        return None
    moved_rad_s: Array = np.diff(x[:, 1])
    return moved_rad_s


def _without_reports(
    x: Array, scale: float, m: Measured, gyro: GyroModel, autopilot_gyro: AutopilotGyroModel
) -> BorderedSystem:
    """Gyro factors without the reported heading; `x`: (k, 2), e and d."""
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
    sigma = np.array([autopilot_gyro.sigma_rad, autopilot_gyro.bias_sigma_rad_s])
    system.add(x[0], sigma, [(first, np.ones(2))])
    system.add(np.array([scale]), autopilot_gyro.scale_sigma, [], [(0, np.ones(1))])
    return system

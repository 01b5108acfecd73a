"""Where odometry speaks against what the walls made of the flight.

Hits on a wrong wall pull the trajectory aside, and then fit well. But from one moment to another
the drone has not moved like that: over some seconds the steps, beside what odometry measured, add
up to far more than its noise does.
"""

import itertools

import numpy as np
from numpy.typing import NDArray

from companion.estimation.line_slam import OdometryModel
from companion.estimation.unknowns import Array, Measured, Unknowns

SPANS_S = (2.0, 4.0, 8.0, 16.0)
"""Of long ones only those in which no shorter one shows where it was."""
SIGMAS = 3.0
TOGETHER_S = 30.0
"""What lies between two such moments no farther apart was pulled aside by the first and let go at
the second."""


def contradicted(x: Unknowns, m: Measured, model: OdometryModel) -> NDArray[np.bool_]:
    """(k,): the keyframes about which odometry says something else."""
    time_s = np.concatenate([[0.0], np.cumsum(m.dt_s)])
    strain_m, variance_m2 = _sums(x, m, model)
    against = np.zeros(len(time_s), dtype=bool)
    for span_s in SPANS_S:
        begin = np.arange(np.searchsorted(time_s, time_s[-1] - span_s, side="right"))
        end = np.searchsorted(time_s, time_s[begin] + span_s)
        strained_m = np.abs(strain_m[end] - strain_m[begin]).max(axis=1, initial=0.0)
        sigma_m = np.sqrt(variance_m2[end] - variance_m2[begin])
        known = against.copy()
        for wrong in np.flatnonzero(strained_m > SIGMAS * sigma_m):
            span = slice(begin[wrong], end[wrong] + 1)
            against[span] |= not known[span].any()
    at = np.flatnonzero(against)
    for before, after in itertools.pairwise(at):
        against[before:after] |= time_s[after] - time_s[before] < TOGETHER_S
    return against


def _sums(x: Unknowns, m: Measured, model: OdometryModel) -> tuple[Array, Array]:
    """Added up from the first keyframe to each: (k, 2) metres beside odometry, (k,) variances."""
    yaw = x.poses[:-1, 2]
    cos_yaw, sin_yaw = np.cos(yaw), np.sin(yaw)
    forward, right = (1 + x.odometry_scale) * m.moved_frd_m.T
    by_odometry = np.column_stack(
        [cos_yaw * forward - sin_yaw * right, sin_yaw * forward + cos_yaw * right]
    )
    strain_m = np.zeros((len(x.poses), 2))
    strain_m[1:] = np.cumsum(np.diff(x.poses[:, :2], axis=0) - by_odometry, axis=0)
    variance_m2 = np.zeros(len(x.poses))
    variance_m2[1:] = np.cumsum(model.step_sigma_m(m.dt_s) ** 2)
    return strain_m, variance_m2

"""Computes how far the path of a map is probably off, given the odometry's errors as they were.

The smoother's model of the heading is that of a gyro. Wheels err by far more, such as 15° in 5 m.
Walls correct that where they are seen. In between, the path is not known better than the odometry.
So the heading errors of the odometry are measured along the corrected path. With this noise the
equations of the smoother give the covariance of the path. Samples of the path are drawn from it and
moved onto the path, as a reference is for an absolute trajectory error (ATE).

The measured errors contain a constant drift, which the smoother estimates. So the result is an
upper bound: on public logs the actual ATE was 0.4 of it in the median.
"""

from dataclasses import replace

import numpy as np

from companion.core.arrays import Array
from companion.estimation.smoothing.state import YAW, Measured
from companion.offline.growth import IncrementalMap

MEASURED_OVER_M = 5.0
"""Length of path over which the odometry's turn is compared, m. Chosen: a wall is that long."""
OVERLAPPING = 4
"""Comparisons in each such length. Chosen."""
SAMPLES = 40
"""Samples of the path. Chosen: their median is then known to a tenth."""


def expected_error_m(solution: IncrementalMap, m: Measured) -> float:
    """The expected ATE of a path, m."""
    length_m = np.hypot(*m.moved_frd_m.T)
    variance_rad2 = turn_variance_rad2_per_m(solution.x.poses[:, YAW], m, length_m) * length_m
    paths = solution.sampled_paths(replace(m, gap_rad2=variance_rad2), SAMPLES)
    return float(np.median([apart_m(path, solution.x.poses[:, :2]) for path in paths]))


def turn_variance_rad2_per_m(yaw_rad: Array, m: Measured, length_m: Array) -> float:
    """Variance of the error of the odometry's turn for each metre of path.

    `yaw_rad` (k,): corrected headings; `length_m` (k - 1,): lengths of the steps.
    """
    error_rad = np.concatenate([[0.0], np.cumsum(np.diff(yaw_rad) - m.turned_rad)])
    along_m = np.concatenate([[0.0], np.cumsum(length_m)])
    over_m = min(MEASURED_OVER_M, float(along_m[-1]))
    if not over_m:
        return 0.0
    begins_m = np.arange(0.0, along_m[-1] - over_m + over_m / OVERLAPPING, over_m / OVERLAPPING)
    turned_rad = np.interp(begins_m + over_m, along_m, error_rad)
    turned_rad -= np.interp(begins_m, along_m, error_rad)
    return float((turned_rad**2).mean()) / over_m


def apart_m(path: Array, other: Array) -> float:
    """Root mean square distance of two paths (k, 2), the first moved and turned onto the other."""
    to_complex = np.array([1, 1j])
    place, other_place = path @ to_complex, other @ to_complex
    place, other_place = place - place.mean(), other_place - other_place.mean()
    turn = np.vdot(place, other_place)
    moved = place * turn / abs(turn) if turn else place
    return float(np.sqrt((np.abs(moved - other_place) ** 2).mean()))

"""The filters go on from what the smoother knows, with its covariance.

The heading filter takes heading, bias, gyro scale and directions; the position filter takes
position, odometry scale and the walls' offsets from anchors in the middle of what has been seen of
each, where direction and offset depend on each other least.
"""

import numpy as np

from companion.estimation.heading import HeadingFilter
from companion.estimation.line_slam import LineSlam, Wall
from companion.estimation.smoother import Knowledge

_NORTH, _EAST, _YAW, _BIAS, _GYRO_SCALE, _ODOMETRY_SCALE, _WALLS = range(7)
"""Places in the covariance of `Knowledge`."""


def restart(heading: HeadingFilter, slam: LineSlam, known: Knowledge) -> None:
    """Set both filters to the last keyframe."""
    directions = _WALLS + 2 * np.arange(len(known.walls))
    chosen = np.array([_YAW, _BIAS, _GYRO_SCALE, *directions])
    heading.restart(
        np.array([known.yaw_rad, known.bias_rad_s, known.gyro_scale, *known.walls[:, 0]]),
        known.covariance[np.ix_(chosen, chosen)],
    )
    walls, offset_by = [], np.zeros((3 + len(known.walls), len(known.covariance)))
    offset_by[[0, 1, 2], [_NORTH, _EAST, _ODOMETRY_SCALE]] = 1.0
    for i, ((normal_rad, offset_m), (low_m, high_m)) in enumerate(
        zip(known.walls, known.reaches_m, strict=True)
    ):
        middle_m, half_m = 0.5 * (low_m + high_m), 0.5 * (high_m - low_m)
        cos_n, sin_n = np.cos(normal_rad), np.sin(normal_rad)
        anchor = (
            float(offset_m * cos_n - middle_m * sin_n),
            float(offset_m * sin_n + middle_m * cos_n),
        )
        walls.append(Wall(i, anchor, -half_m, half_m))
        # d = ρ - a·n(α):  δd = δρ - (a·t) δα
        offset_by[3 + i, directions[i] : directions[i] + 2] = -middle_m, 1.0
    state = np.zeros(3 + len(walls))
    state[:3] = *known.position_ne_m, known.odometry_scale
    slam.restart(state, offset_by @ known.covariance @ offset_by.T, walls)

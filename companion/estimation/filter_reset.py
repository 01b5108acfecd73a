"""Restarts the filters from the smoother's result or from its prior, with the covariance.

The heading filter takes heading, bias, gyro scale and wall directions. The position filter takes
position, odometry scale, wander and wall offsets. Each wall's anchor is the middle of its hits,
where direction and offset are least correlated.
"""

import numpy as np

from companion.core.arrays import Array
from companion.estimation.filters.heading_filter import HeadingFilter
from companion.estimation.filters.position_filter import LineSlam, Wall
from companion.estimation.smoothing.state import (
    BIAS,
    CALIBRATION_SIZE,
    EAST,
    GYRO_SCALE,
    NORTH,
    ODOMETRY_SCALE,
    POSE_SIZE,
    WALL_SIZE,
    WANDER_EAST,
    WANDER_NORTH,
    YAW,
    Unknowns,
)

_GYRO_SCALE, _ODOMETRY_SCALE = POSE_SIZE + GYRO_SCALE, POSE_SIZE + ODOMETRY_SCALE
_WALLS = POSE_SIZE + CALIBRATION_SIZE


def restart(heading: HeadingFilter, slam: LineSlam, x: Unknowns, covariance: Array) -> None:
    """Set both filters to the state of the last keyframe.

    `covariance` (pose + shared, pose + shared): of that keyframe and the shared unknowns.
    """
    pose = x.poses[-1]
    directions = _WALLS + WALL_SIZE * np.arange(len(x.walls))
    chosen = np.array([YAW, BIAS, _GYRO_SCALE, *directions])
    heading.restart(
        np.array([pose[YAW], pose[BIAS], *x.gyro_scale, *x.walls[:, 0]]),
        covariance[np.ix_(chosen, chosen)],
    )
    # d = ρ - a·n(α):  δd = δρ - (a·t) δα
    middle_m = x.reach_m.mean(axis=1)
    half_m = 0.5 * np.ptp(x.reach_m, axis=1)
    anchors = x.walls[:, 1:] * x.normals + middle_m[:, None] * x.tangents
    moving = [NORTH, EAST, _ODOMETRY_SCALE, WANDER_NORTH, WANDER_EAST]
    offset_by = np.zeros((len(moving) + len(x.walls), len(covariance)))
    offset_by[np.arange(len(moving)), moving] = 1.0
    row = len(moving) + np.arange(len(x.walls))
    offset_by[row, directions], offset_by[row, directions + 1] = -middle_m, 1.0
    state = np.zeros(len(moving) + len(x.walls))
    state[: len(moving)] = (*pose[:YAW], *x.odometry_scale, *pose[WANDER_NORTH:])
    walls = [
        Wall(i, (north, east), -half, half)
        for i, ((north, east), half) in enumerate(
            zip(anchors.tolist(), half_m.tolist(), strict=True)
        )
    ]
    slam.restart(state, offset_by @ covariance @ offset_by.T, walls)

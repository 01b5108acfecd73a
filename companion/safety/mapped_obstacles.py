"""Recalls older obstacles near the drone from the map.

`obstacle_memory.py` deletes its points when odometry may have drifted too far. The map keeps them.
An example is the end of a wall that was detected three minutes ago and is not detected again
before the drone reaches it.

    occupied cells near the drone, last detected more than KEPT_S ago
        - cells where the drone has been since take-off
        - cells beside a recent obstacle point, which is more accurate
    = recalled
"""

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import points_to_frd
from companion.core.messages import Pose
from companion.mapping.occupancy import Occupancy
from companion.safety.control_laws import BODY_RADIUS_M
from companion.safety.obstacle_points import KEPT_S

RECALLED_WITHIN_M = 2.0
"""Search radius from the drone's centre, m. Chosen: from 1 m/s the drone stops within 1.5 m
(0.5 m/s² and a lag of 0.5 s)."""
MET_ANEW_M = 0.4
"""Cells within this distance of a recent obstacle point are dropped, m. Chosen: the map, including
its cell size, differs from odometry by as much."""


def recalled_frd_m(grid: Occupancy, pose: Pose, lately_frd_m: Array) -> Array:
    """Return recalled points (r, 2), m, forward and right of the drone's centre.

    `lately_frd_m` (n, 2) contains the recent obstacle points, body FRD.
    """
    here = pose.ne_m
    before_s = pose.time_s - KEPT_S
    met_ne_m = grid.met_before(before_s, here, RECALLED_WITHIN_M, BODY_RADIUS_M)
    if not len(met_ne_m):
        return met_ne_m
    recalled = points_to_frd(met_ne_m - here, pose.yaw_rad)
    if not len(lately_frd_m):
        return recalled
    apart_m = np.linalg.norm(recalled[:, None] - lately_frd_m, axis=2).min(axis=1)
    kept: Array = recalled[apart_m > MET_ANEW_M]
    return kept

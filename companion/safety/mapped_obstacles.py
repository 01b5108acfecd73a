"""What was met near here so long ago that only the map knows it.

The points of `obstacle_memory.py` are forgotten when odometry may have drifted too far. The end of
a wall that was met three minutes ago, and is not met again before the drone comes to it, is still
in the map:

    occupied cells near the drone, last met before KEPT_S
        - those where the drone itself has been since take-off
        - those beside something that was met lately, which tells better where it is
    = recalled
"""

import numpy as np

from companion.core.frames import points_to_frd
from companion.core.messages import Pose
from companion.mapping.occupancy import Occupancy
from companion.safety.obstacle_points import KEPT_S, Points
from companion.safety.velocity_guard import BODY_RADIUS_M

RECALLED_WITHIN_M = 2.0
"""From the drone's centre: from 1 m/s it stops within 1.5 m (0.5 m/s2, and a lag of 0.5 s)."""
MET_ANEW_M = 0.4
"""So near to it something was met lately. Chosen: the map, cells and all, is off by as much beside
what odometry knows."""


def recalled_frd_m(grid: Occupancy, pose: Pose, lately_frd_m: Points) -> Points:
    """(r, 2), forward and right of the drone's centre; `lately_frd_m` (n, 2) was met lately."""
    here = pose.ne_m
    before_s = pose.time_s - KEPT_S
    met_ne_m = grid.met_before(before_s, here, RECALLED_WITHIN_M, BODY_RADIUS_M)
    if not len(met_ne_m):
        return met_ne_m
    recalled = points_to_frd(met_ne_m - here, pose.yaw_rad)
    if not len(lately_frd_m):
        return recalled
    apart_m = np.linalg.norm(recalled[:, None] - lately_frd_m, axis=2).min(axis=1)
    kept: Points = recalled[apart_m > MET_ANEW_M]
    return kept

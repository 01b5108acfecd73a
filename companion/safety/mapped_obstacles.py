"""Compares the obstacle memory with the map: each contains obstacles that the other has lost.

`obstacle_memory.py` deletes its points when odometry may have drifted too far. The map keeps them.
An example is the end of a wall that was detected three minutes ago and is not detected again
before the drone reaches it.

    occupied cells near the drone, last detected more than KEPT_S ago
        - cells where the drone has been since take-off
        - cells beside a recent obstacle point, which is more accurate
    = recalled

The map loses a pole thinner than a cell, because more beams pass through the cell than hit the
pole. The memory keeps it until beams have passed through all of its width.

    recent obstacle points that were measured
        - points beside an occupied cell
    = unmapped
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import points_to_frd, to_nearest_m
from companion.core.messages import Beam, Pose, RangeUnit, WallSegment
from companion.mapping.occupancy import Occupancy
from companion.safety.control_laws import BODY_RADIUS_M
from companion.safety.obstacle_points import KEPT_S

RECALLED_WITHIN_M = 2.0
"""Search radius from the drone's centre, m. Chosen: from 1 m/s the drone stops within 1.5 m
(0.5 m/s² and a lag of 0.5 s)."""
MAPPED_M = 0.25
"""A point within this distance of an occupied cell is mapped, m. Chosen: the position errors of
both within seconds; a larger distance would drop the poles beside a wall."""
MET_ANEW_M = 0.4
"""Cells within this distance of a recent obstacle point are dropped, m. Chosen: the map, including
its cell size, differs from odometry by as much."""
END_M = 0.15
"""A wall is not certain to be met within this distance of its ends, m. Chosen: three sigmas of the
pad and of the position in the map together."""


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
    kept: Array = recalled[to_nearest_m(recalled, lately_frd_m) > MET_ANEW_M]
    return kept


def ends_ne_m(walls: Sequence[WallSegment]) -> Array:
    """Return both ends of what is certain of each wall, (w, 2, 2), for `walls_ahead_m`."""
    ends = np.array([(wall.start_ne_m, wall.end_ne_m) for wall in walls]).reshape(-1, 2, 2)
    span = ends[:, 1] - ends[:, 0]
    length_m = np.maximum(np.hypot(*span.T), 1e-9)
    less = np.minimum(END_M / length_m, 0.5)[:, None] * span
    return np.stack([ends[:, 0] + less, ends[:, 1] - less], axis=1)


def walls_ahead_m(
    walls_ne_m: Array, pose: Pose, units: Mapping[Beam, RangeUnit]
) -> dict[Beam, float]:
    """Return the distance from each sensor to the nearest of the walls along its beam, m.

    `walls_ne_m` (w, 2, 2): both ends of each wall. Beams that meet none are left out.
    """
    if not len(walls_ne_m):
        return {}
    start_north, start_east = (walls_ne_m[:, 0] - pose.ne_m).T
    span_north, span_east = (walls_ne_m[:, 1] - walls_ne_m[:, 0]).T
    bearings_rad = [pose.yaw_rad + unit.bearing_frd_rad for unit in units.values()]
    offsets_m = np.array([unit.offset_m for unit in units.values()])
    north, east = np.cos(bearings_rad)[:, None], np.sin(bearings_rad)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):  # a wall along the beam is not met
        per_metre = 1 / (span_north * east - span_east * north)  # (beams, w)
        share = (start_east * north - start_north * east) * per_metre
        along_m = (start_east * span_north - start_north * span_east) * per_metre
    is_met = (share >= 0) & (share <= 1) & (along_m > offsets_m[:, None])
    nearest_m = np.where(is_met, along_m, np.inf).min(axis=1) - offsets_m
    ahead_m = zip(units, nearest_m.tolist(), strict=True)
    return {beam: distance_m for beam, distance_m in ahead_m if distance_m < math.inf}


def unmapped_ne_m(grid: Occupancy, pose: Pose, measured_frd_m: Array) -> Array:
    """Return those of the measured recent points (n, 2), body FRD, that the map lost: local NED, m.

    Shape (u, 2).
    """
    if not len(measured_frd_m):
        return measured_frd_m
    points_ne_m = points_to_frd(measured_frd_m, -pose.yaw_rad) + pose.ne_m
    unmapped: Array = points_ne_m[~grid.is_met_near(points_ne_m, MAPPED_M)]
    return unmapped

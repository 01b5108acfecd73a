"""Computes the line segments that the beams swept, from the drone to each hit."""

import numpy as np

from companion.core.arrays import Array
from companion.core.messages import FloorPlan

MAX_NOISE_M = 1.0
"""A hit at most this far behind a wall belongs to the wall, m. Chosen."""


def rays(plan: FloorPlan) -> Array:
    """Segments from the drone to each hit, cut off at a wall that the hit lies just behind.

    A map read from map.json has no hits, so the
    result is empty.
    """
    starts = eyes_xy_m(plan)
    if not len(starts):
        return np.empty((0, 2, 2))
    ends = np.array([hit.position_ned_m for hit in plan.hits])[:, 1::-1]
    walls = np.array([(wall.start_ne_m, wall.end_ne_m) for wall in plan.walls])
    return _up_to_walls(np.stack([starts, ends], axis=1), walls.reshape(-1, 2, 2)[:, :, ::-1])


def eyes_xy_m(plan: FloorPlan) -> Array:
    """(n, 2): the drone's place, east and north, at each hit, m; none without hits or path."""
    if not plan.hits or not plan.path:
        return np.empty((0, 2))
    times_s = [hit.time_s for hit in plan.hits]
    known_s = [pose.time_s for pose in plan.path]
    east_m = np.interp(times_s, known_s, [pose.east_m for pose in plan.path])
    north_m = np.interp(times_s, known_s, [pose.north_m for pose in plan.path])
    return np.column_stack([east_m, north_m])


def _up_to_walls(lines: Array, walls: Array) -> Array:
    """Shorten lines that end less than `MAX_NOISE_M` behind a wall, so that they end on it."""
    start, along = lines[:, None, 0], lines[:, None, 1] - lines[:, None, 0]
    wall, wall_along = walls[None, :, 0], walls[None, :, 1] - walls[None, :, 0]
    cross = _cross(along, wall_along)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = _cross(wall - start, wall_along) / cross
        wall_share = _cross(wall - start, along) / cross
    overshot_m = (1 - share) * np.linalg.norm(along, axis=2)
    meets = (wall_share >= 0) & (wall_share <= 1) & (overshot_m >= 0) & (overshot_m < MAX_NOISE_M)
    share = np.where(meets, share, 1.0).min(axis=1, initial=1.0)
    return np.stack([lines[:, 0], lines[:, 0] + share[:, None] * along[:, 0]], axis=1)


def _cross(a: Array, b: Array) -> Array:
    product: Array = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product

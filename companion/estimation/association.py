"""Which hit belongs to which wall, and which walls are one.

Decided anew in every round of the smoother, with an ever narrower gate.
"""

import math

import numpy as np

from companion.estimation.unknowns import Array, Indices, Measured, RangeNoise, Sightings, Unknowns
from companion.frames import wrap_rad

GATE_SIGMAS = 3.0
LEAST_COS_INCIDENCE = math.cos(math.radians(70))
NEAR_END_SIGMAS = 2.0
SAME_DIRECTION_RAD = math.radians(8)
SAME_PLACE_M = 0.35
LEAST_HITS = 12
LEAST_EXTENT_M = 0.6


def match(
    x: Unknowns,
    m: Measured,
    seen: Sightings,
    noise: RangeNoise,
    gate_m: float,
) -> Indices:
    """(n,): each hit's wall or -1; the one it fits best, within `gate_m` and three sigmas."""
    if not len(m.frame) or not len(x.walls):
        return np.full(len(m.frame), -1)
    cos_incidence = seen.beams @ x.normals.T
    usable = cos_incidence > LEAST_COS_INCIDENCE
    distance_m = x.walls[:, 1] - seen.eyes @ x.normals.T
    expected_m = distance_m / np.where(usable, cos_incidence, 1.0) - m.mount_offset_m
    usable &= expected_m > noise.min_m
    sigma_m = noise.sigma_m(expected_m)
    # Near the end of the range long readings are missing, which would pull walls closer.
    usable &= expected_m < noise.max_m - NEAR_END_SIGMAS * sigma_m
    unbiased_m = (1 - x.range_gain[m.beam]) * m.distance_m
    misfit = np.abs(noise.signal(unbiased_m)[:, None] - noise.signal(expected_m))
    usable &= misfit < GATE_SIGMAS + gate_m / (sigma_m * cos_incidence)
    misfit = np.where(usable, misfit, np.inf)
    wall = misfit.argmin(axis=1)
    fits = np.isfinite(misfit[np.arange(len(wall)), wall])
    return np.where(fits, wall, -1)


def merge_and_drop(x: Unknowns, seen: Sightings, wall_of: Indices) -> Indices:
    """Make one of walls that are one, leave out walls without support; the hits' walls anew."""
    support = np.bincount(wall_of[wall_of >= 0], minlength=len(x.walls))
    kept: list[int] = []
    becomes = np.full(len(x.walls) + 1, -1)  # the last entry is for hits without a wall
    for wall in np.argsort(-support, kind="stable"):
        mine = seen.points[wall_of == wall]
        if support[wall] < LEAST_HITS or _extent_m(mine, x.walls[wall]) < LEAST_EXTENT_M:
            continue
        twin = next((k for k in kept if _is_same(x.walls[k], x.walls[wall], mine)), None)
        if twin is None:
            kept.append(int(wall))
            becomes[wall] = len(kept) - 1
        else:
            becomes[wall] = becomes[twin]
    x.walls = x.walls[kept].reshape(-1, 2)
    renumbered: Indices = becomes[wall_of]
    return renumbered


def _extent_m(points: Array, wall: Array) -> float:
    along = points @ np.array([-math.sin(wall[0]), math.cos(wall[0])])
    return float(np.ptp(along)) if len(along) else 0.0


def _is_same(wall: Array, other: Array, points_of_other: Array) -> bool:
    if abs(wrap_rad(float(wall[0] - other[0]))) > SAME_DIRECTION_RAD:
        return False
    across = points_of_other @ np.array([math.cos(wall[0]), math.sin(wall[0])]) - wall[1]
    return bool(abs(np.median(across)) < SAME_PLACE_M)

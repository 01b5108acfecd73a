"""Which hit belongs to which wall, and which walls there are.

Decided anew in every round of the smoother, with an ever narrower gate. A wall stays if it is
worth its two unknowns: if the hits would fit clearly worse without it. Walls that are one, and
rows of noise beside a real wall, are not.
"""

import math

import numpy as np

from companion.estimation.unknowns import (
    WALL_SIZE,
    Array,
    Indices,
    Measured,
    RangeNoise,
    Sightings,
    Unknowns,
    project,
)
from companion.frames import wrap_rad

GATE_SIGMAS = 3.0
LEAST_COS_INCIDENCE = math.cos(math.radians(70))
NEAR_END_SIGMAS = 2.0
SAME_DIRECTION_RAD = math.radians(15)
LEAST_HITS = 12
LEAST_EXTENT_M = 0.6
LARGEST_GAP_M = 1.5
"""A piece of a wall farther than this from the rest of it must have support of its own."""
UNEXPLAINED = GATE_SIGMAS**2
"""χ² of a hit that fits no wall."""
LEAST_WORTH, LEAST_WORTH_A_HIT = 60.0, 2.0
"""By how much a wall must lower the χ² of all hits. Two lines through the noise of one wall lower
it by about 1 for each hit."""
MOST_MEAN_COST = 1.8


def associate(x: Unknowns, m: Measured, noise: RangeNoise, gate_m: float) -> Indices:
    """(n,): each hit's wall or -1, after walls without worth have been taken out of `x`."""
    seen = project(x, m)
    misfit = misfits(x, m, seen, noise, gate_m)
    sigma_m = noise.sigma_m(m.distance_m) + gate_m / GATE_SIGMAS
    if _merge(x, seen, sigma_m, best(misfit)):
        misfit = misfits(x, m, seen, noise, gate_m)
    _cut_off_strays(x, seen, misfit)
    kept = _worthy(x, seen, misfit)
    x.walls = x.walls[kept]
    return best(misfit[:, kept])


def misfits(x: Unknowns, m: Measured, seen: Sightings, noise: RangeNoise, gate_m: float) -> Array:
    """(n, w): how far off each wall each hit is, in widened sigmas; inf if it cannot be on it.

    Three of them are three sigmas of the range and `gate_m`, which is what the poses may be off.
    """
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
    widened = 1 + gate_m / (GATE_SIGMAS * sigma_m * np.maximum(cos_incidence, LEAST_COS_INCIDENCE))
    misfit /= widened
    return np.where(usable & (misfit < GATE_SIGMAS), misfit, np.inf)


def best(misfit: Array) -> Indices:
    """(n,): the wall that each hit fits best, -1 if none."""
    if not misfit.shape[1]:
        return np.full(len(misfit), -1)
    wall = misfit.argmin(axis=1)
    return np.where(np.isfinite(misfit[np.arange(len(wall)), wall]), wall, -1)


def _merge(x: Unknowns, seen: Sightings, sigma_m: Array, wall_of: Indices) -> bool:
    """Make one of walls that are one; keep none without hits. Whether that changed any.

    Two are one if a common line fits the hits of both as well as their noise allows.
    """
    support = np.bincount(wall_of[wall_of >= 0], minlength=len(x.walls))
    kept: list[tuple[Array, Indices]] = []
    for wall in np.argsort(-support, kind="stable"):
        mine = np.flatnonzero(wall_of == wall)
        if not len(mine):
            continue
        own = x.walls[wall]
        for i, (line, hits) in enumerate(kept):
            if abs(wrap_rad(float(line[0] - own[0]))) > SAME_DIRECTION_RAD:
                continue
            both = np.concatenate([hits, mine])
            common = _fitted(line, seen.points[both], sigma_m[both])
            if _mean_cost(common, seen.points[both], sigma_m[both]) < MOST_MEAN_COST:
                kept[i] = common, both
                break
        else:
            kept.append((own, mine))
    if len(kept) == len(x.walls):
        return False
    x.walls = np.array([line for line, _ in kept]).reshape(-1, WALL_SIZE)
    return True


def _fitted(line: Array, points: Array, sigma_m: Array) -> Array:
    """The line moved and turned to fit the points best; it is nearly there already."""
    normal = np.array([math.cos(line[0]), math.sin(line[0])])
    along = points @ (-normal[1], normal[0])
    slope, across_m = np.polyfit(along, points @ normal, 1, w=1 / sigma_m)
    turned_rad = math.atan(slope)
    return np.array([line[0] - turned_rad, across_m * math.cos(turned_rad)])


def _mean_cost(line: Array, points: Array, sigma_m: Array) -> float:
    """χ² of points about a line by their number, each at most that of an unexplained one."""
    across_m = points @ (math.cos(line[0]), math.sin(line[0])) - line[1]
    return float(np.minimum((across_m / sigma_m) ** 2, UNEXPLAINED).mean())


def _worthy(x: Unknowns, seen: Sightings, misfit: Array) -> Indices:
    """The walls that are worth having; the least worthy is taken out first, then all is redone."""
    cost = np.minimum(misfit**2, UNEXPLAINED)
    along = _along_m(x.walls, seen)
    kept = np.arange(misfit.shape[1])
    while len(kept):
        wall_of = best(misfit[:, kept])
        supported = [_supports(along[wall_of == i, wall]) for i, wall in enumerate(kept)]
        hits = np.bincount(wall_of[wall_of >= 0], minlength=len(kept))
        needed = np.maximum(LEAST_WORTH, LEAST_WORTH_A_HIT * hits)
        worth = np.where(supported, _worths(cost[:, kept]) / needed, 0.0)
        least = int(worth.argmin())
        if worth[least] >= 1:
            break
        kept = np.delete(kept, least)
    return kept


def _worths(cost: Array) -> Array:
    """(w,): how much more the hits would cost without each wall."""
    if cost.shape[1] == 1:
        return np.array([np.sum(UNEXPLAINED - cost)])
    two = np.partition(cost, 1, axis=1)[:, :2]
    mine = cost.argmin(axis=1)
    worth = np.bincount(mine, two[:, 1] - two[:, 0], cost.shape[1])
    return worth.astype(np.float64)


def _supports(along_m: Array) -> bool:
    """Enough hits to make a piece of wall, and not all in one spot."""
    return len(along_m) >= LEAST_HITS and float(np.ptp(along_m)) >= LEAST_EXTENT_M


def _along_m(walls: Array, seen: Sightings) -> Array:
    """(n, w): coordinates of the hits along t = (-sin, cos)(normal)."""
    along: Array = seen.points @ np.array([-np.sin(walls[:, 0]), np.cos(walls[:, 0])])
    return along


def _cut_off_strays(x: Unknowns, seen: Sightings, misfit: Array) -> None:
    """Keep hits from a wall that goes by there only as a line, by `misfit` = inf.

    A piece far from the main one must be worth it by itself; where the line crosses another
    wall, it is not.
    """
    wall_of = best(misfit)
    cost = np.minimum(misfit**2, UNEXPLAINED)
    along = _along_m(x.walls, seen)
    for wall in range(len(x.walls)):
        mine: Indices = np.flatnonzero(wall_of == wall)
        mine = mine[np.argsort(along[mine, wall], kind="stable")]
        gaps = np.flatnonzero(np.diff(along[mine, wall]) > LARGEST_GAP_M) + 1
        without = np.delete(cost, wall, axis=1).min(axis=1, initial=UNEXPLAINED)
        pieces = np.split(mine, gaps)
        worth = [float(np.sum(without[piece] - cost[piece, wall])) for piece in pieces]
        main = int(np.argmax(worth))
        for i, piece in enumerate(pieces):
            if i != main and worth[i] < max(LEAST_WORTH, LEAST_WORTH_A_HIT * len(piece)):
                misfit[piece, wall] = np.inf

"""Tests whether hits lie on a straight line or on a line with a bend.

A single line can fit hits on two walls of a bay, each hit within its noise. Two lines, one for the
hits before a place and one for those after it, fit them far better:

    one      ───────────────────
                   . ' ' .
    hits     . . '         ' . .

Means over a quarter of a metre are compared, because hits at one place share the error of the pose.
"""

from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Mask

BIN_M = 0.25
"""Hits are averaged over this length, m. Chosen."""
FLOOR_M = 0.03
"""Least sigma of a mean, m. Chosen: skirting and pose errors limit it."""
MAX_SIGMAS = 3.0
"""The residual of a single hit is limited to this, in sigmas. Chosen."""
MIN_BINS = 2
"""Least bins on either side of a bend. Chosen."""
MAX_GAIN = 15.0
"""χ² that two lines save over one at the best bend. Chosen: below 10 for nearly all straight
walls."""


@dataclass(frozen=True, slots=True)
class Bend:
    """The most likely bend of hits along a line."""

    gain: float
    """χ² that two lines save over one."""
    at_m: float
    """Position along the line where the first of them ends, m."""

    @property
    def is_straight(self) -> bool:
        return self.gain < MAX_GAIN


def bend(along_m: Array, across_m: Array, sigma_m: Array) -> Bend:
    """Find the best bend of hits (n,) with coordinates along and across a line and their sigmas."""
    number = np.floor((along_m - along_m.min(initial=0.0)) / BIN_M).astype(np.int64)
    weight = 1 / sigma_m**2
    within_m = np.clip(across_m, -MAX_SIGMAS * sigma_m, MAX_SIGMAS * sigma_m)
    total = np.bincount(number, weight)
    filled = np.flatnonzero(total)
    if len(filled) < 2 * MIN_BINS:
        return Bend(0.0, 0.0)
    place_m = np.bincount(number, weight * along_m)[filled] / total[filled]
    mean_m = np.bincount(number, weight * within_m)[filled] / total[filled]
    weight = 1 / (1 / total[filled] + FLOOR_M**2)
    place_m -= place_m.mean()
    before = _square_to(place_m, mean_m, weight)
    after = _square_to(place_m[::-1], mean_m[::-1], weight[::-1])[::-1]
    gains = (before[-1] - before[:-1] - after[1:])[MIN_BINS - 1 : 1 - MIN_BINS]
    best = int(gains.argmax())
    last = filled[best + MIN_BINS - 1]
    return Bend(float(gains[best]), float(along_m.min()) + (last + 1) * BIN_M)


def _square_to(x: Array, y: Array, weight: Array) -> Array:
    """χ² (n,) of the first 1, 2, ... n values about their best line."""
    w, wx, wy = weight.cumsum(), (weight * x).cumsum(), (weight * y).cumsum()
    xx = (weight * x * x).cumsum() - wx * wx / w
    xy = (weight * x * y).cumsum() - wx * wy / w
    yy = (weight * y * y).cumsum() - wy * wy / w
    square: Array = np.maximum(yy - xy * xy / np.maximum(xx, 1e-9), 0.0)
    return square


def longer_side(along_m: Array, cut_m: float) -> Mask:
    """(n,): mask of the hits on the side of a cut with more hits."""
    before: Mask = along_m < cut_m
    return before if 2 * before.sum() >= len(before) else ~before

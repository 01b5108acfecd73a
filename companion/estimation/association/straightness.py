"""Whether hits lie along a straight line, or along something that bends.

A line can be put through hits on two walls of a bay, and each hit by itself fits it within its
noise. Two lines, one for the hits before a place and one for those after it, fit them far better:

    one      ───────────────────
                   . ' ' .
    hits     . . '         ' . .

The means over a quarter of a metre are compared, for the many hits at one place share the error of
the pose.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BIN_M = 0.25
FLOOR_M = 0.03
"""Means are not taken to be more exact than this: walls have skirting and poses have errors."""
MAX_SIGMAS = 3.0
"""A single hit counts as no farther off than this."""
MIN_BINS = 2
"""On either side of a bend."""
MAX_GAIN = 15.0
"""χ² by which two lines fit better than one, with the best of all bends: of a straight wall less
than 10, nearly always."""


@dataclass(frozen=True, slots=True)
class Bend:
    """Of hits along a line."""

    gain: float
    """χ² by which two lines fit better than one."""
    at_m: float
    """Where along the line the first of them ends."""

    @property
    def is_straight(self) -> bool:
        return self.gain < MAX_GAIN


def bend(along_m: Array, across_m: Array, sigma_m: Array) -> Bend:
    """Of hits (n,) along a line and across it, with the sigmas of the latter."""
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
    """χ² (n,) of the first 1, 2, ... n values about the line that fits them best."""
    w, wx, wy = weight.cumsum(), (weight * x).cumsum(), (weight * y).cumsum()
    xx = (weight * x * x).cumsum() - wx * wx / w
    xy = (weight * x * y).cumsum() - wx * wy / w
    yy = (weight * y * y).cumsum() - wy * wy / w
    square: Array = np.maximum(yy - xy * xy / np.maximum(xx, 1e-9), 0.0)
    return square


def longer_side(along_m: Array, cut_m: float) -> Mask:
    """(n,): the hits before or after a cut, where there are more."""
    before: Mask = along_m < cut_m
    return before if 2 * before.sum() >= len(before) else ~before

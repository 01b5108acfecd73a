"""Whether hits lie along a straight line, or along something that bends.

A line can be put through hits on two walls of a bay, and each hit by itself fits it within its
noise. Their means over half a metre do not.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BIN_M = 0.5
FLOOR_M = 0.03
"""Means are not taken to be more exact than this: walls have skirting and poses have errors."""
MOST_SIGMAS = 3.0
"""A single hit counts as no farther off than this."""
BEND_SIGMAS = 3.0


@dataclass(frozen=True, slots=True)
class Bend:
    """Of hits about a line."""

    square: float
    """Mean square misfit of the means; about 1 for a straight wall."""
    bins: int
    """How many means."""
    worst_m: float
    """Where along the line the mean is farthest off."""

    @property
    def is_straight(self) -> bool:
        return self.square < 1 + BEND_SIGMAS * math.sqrt(2 / self.bins)


def bend(along_m: Array, across_m: Array, sigma_m: Array) -> Bend:
    """Of hits (n,) along a line and across it, with the sigmas of the latter."""
    number = np.floor((along_m - along_m.min(initial=0.0)) / BIN_M).astype(np.int64)
    weight = 1 / sigma_m**2
    within_m = np.clip(across_m, -MOST_SIGMAS * sigma_m, MOST_SIGMAS * sigma_m)
    total = np.bincount(number, weight)
    filled = np.flatnonzero(total)
    mean_m = np.bincount(number, weight * within_m)[filled] / total[filled]
    misfit = mean_m / np.sqrt(1 / total[filled] + FLOOR_M**2)
    worst = filled[int(np.abs(misfit).argmax())]
    return Bend(
        float(np.mean(misfit**2)), len(filled), float(along_m.min()) + (worst + 0.5) * BIN_M
    )


def longer_side(along_m: Array, cut_m: float) -> Mask:
    """(n,): the hits before or after a cut, where there are more, half a bin away from it."""
    before, after = along_m < cut_m - 0.5 * BIN_M, along_m > cut_m + 0.5 * BIN_M
    return before if before.sum() >= after.sum() else after

"""Finds the heights at which the drone flew level, and the level of each hit.

    number of hits
      │        ▂█▂                ▂▇▂
      │ ▁▁▁▁▁▁▁███▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁███▁▁▁
      └───────────────────────────────── height
                0                  1

Furniture and half-height walls end below a higher level. So a beam of one level that passes over
such a wall is no evidence against it.
"""

import numpy as np

from companion.core.arrays import Array, Indices

BIN_M = 0.1
"""Width of a bin of the histogram, m. Chosen: the deviation from the height of a level."""
APART_M = 0.35
"""Least difference between two levels, m. Chosen: more than the deviations at two levels."""
MIN_SHARE = 0.1
"""A level has at least this share of the hits at the level with the most. Chosen: the drone climbs
past the heights between two levels with fewer."""


def levels(height_m: Array) -> Indices:
    """(n,): level of each hit by its height (n,), from 0 at the lowest."""
    if not len(height_m):
        return np.empty(0, dtype=np.int64)
    bins = np.floor(height_m / BIN_M).astype(np.int64)
    count = np.bincount(bins - bins.min() + 1, minlength=3)
    beside = np.convolve(np.append(count, 0), np.ones(3), mode="same")
    middle_m = BIN_M * (np.arange(len(beside)) + bins.min() - 0.5)
    found: list[float] = []
    for most in np.argsort(-beside, kind="stable"):
        if beside[most] < MIN_SHARE * beside.max():
            break
        if all(abs(middle_m[most] - each) >= APART_M for each in found):
            found.append(float(middle_m[most]))
    nearest: Indices = np.abs(height_m[:, None] - np.sort(found)).argmin(axis=1)
    return nearest

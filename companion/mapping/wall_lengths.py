"""Estimates how well the length of a wall is known, from what its two ends are.

        ┌──────────────      a corner: the end is as certain as the wall that meets it
        │
        └───────── ·  ·      a free end: the last hits of the wall, which lie beside its true end

The walls' errors are taken as independent. Those of the drone's position are common to both ends
and cancel in the length, so the result is rather too large.
"""

from collections.abc import Sequence

import numpy as np

from companion.core.arrays import Array
from companion.core.messages import WallSegment

CORNER_M = 0.3
"""Largest distance of an end from the wall that meets it, m. Chosen: walls of a corner end within
a few sigmas of each other."""
MIN_SINE = 0.7
"""Least sine of the angle between two walls of a corner: 45°. Chosen."""
FREE_END_M = 0.07
"""Standard deviation of a free end, m. Chosen: half of the 14 cm by which eight doorways, taken
between the last hits of both jambs, were too narrow on average."""

TOLERANCE_SIGMAS = 2
"""Tolerance of a length, standard deviations: 19 of 20."""


def length_sigmas_m(walls: Sequence[WallSegment]) -> Array:
    """Standard deviation of the length of each wall, (n,), m."""
    if not walls:
        return np.empty(0)
    ends = np.array([(wall.start_ne_m, wall.end_ne_m) for wall in walls], dtype=float)  # (n, 2, 2)
    along = (ends[:, 1] - ends[:, 0]) / np.array([[wall.length_m] for wall in walls])
    sines = np.abs(along[:, None, 0] * along[:, 1] - along[:, None, 1] * along[:, 0])  # (n, n)
    off = ends[:, :, None] - ends[:, 0]  # (n, 2, n, 2): from each wall's start to each end
    lengths_m = np.array([wall.length_m for wall in walls])
    at_m = (off * along).sum(axis=-1)  # (n, 2, n): of each end along each wall
    foot = np.clip(at_m, 0.0, lengths_m)[..., None] * along
    apart_m = np.hypot(*np.moveaxis(off - foot, -1, 0))
    apart_m = np.where(sines[:, None] >= MIN_SINE, apart_m, np.inf)
    sigmas_m = np.array([wall.sigma_m for wall in walls])
    turns_rad = np.array([wall.normal_sigma_rad for wall in walls])
    across_m = np.hypot(sigmas_m, turns_rad * (at_m - lengths_m / 2))
    across_m /= np.maximum(sines, MIN_SINE)[:, None]
    nearest = np.argmin(apart_m, axis=-1)[..., None]  # (n, 2, 1)
    is_corner = np.take_along_axis(apart_m, nearest, axis=-1) < CORNER_M
    end_m = np.where(is_corner, np.take_along_axis(across_m, nearest, axis=-1), FREE_END_M)
    length_m: Array = np.hypot(*end_m[..., 0].T)
    return length_m

"""Selects pairs of walls to constrain to right angles.

After half a minute or a few corners a direction has a sigma of two degrees. Most buildings have
right angles, so a wall that is this close to one most likely has it. A wall that is known more
exactly and is still oblique is not constrained.
"""

import math
from collections.abc import Sequence

import numpy as np

from companion.core.arrays import Array
from companion.estimation.smoothing.factors import SQUARE_SIGMA_RAD, off_square_rad

WITHIN_SIGMAS = 3.0
"""Largest deviation from a right angle, in sigmas. Chosen."""
WITHIN_RAD = math.radians(8)
"""Largest deviation from a right angle, rad. Chosen."""


def square_pairs(directions_rad: Sequence[Array], covariance: Array) -> tuple[tuple[int, int], ...]:
    """Pairs of a wall and the more certain wall to which it most likely is at a multiple of 90°.

    The walls are not all paired with one: wings of a building may be oblique. `directions_rad`,
    (w,) each, are the directions before and after a step, with covariance (w, w) of the latter. The
    smaller deviation counts, so hits on something else cannot turn a wall away from its right
    angle.
    """
    own = np.diag(covariance)
    variance = own[:, None] + own - 2 * covariance
    sigma_rad = np.sqrt(np.maximum(variance, 0.0) + SQUARE_SIGMA_RAD**2)
    off_rad = [off_square_rad(angles_rad[:, None] - angles_rad) for angles_rad in directions_rad]
    least_off_rad = np.abs(off_rad).min(axis=0)
    may_be = least_off_rad < np.minimum(WITHIN_RAD, WITHIN_SIGMAS * sigma_rad)
    may_be &= own < own[:, None]
    likelihood = np.exp(-0.5 * (least_off_rad / sigma_rad) ** 2) / sigma_rad
    return tuple(
        (int(wall), int(np.where(may_be[wall], likelihood[wall], 0.0).argmax()))
        for wall in np.flatnonzero(may_be.any(axis=1))
    )

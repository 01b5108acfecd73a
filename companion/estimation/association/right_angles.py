"""Which walls seem to be meant square.

Half a minute round a corner or two a direction is known to two degrees. So many buildings are
square that even then it is likelier that a wall is than that it is askew by as much. What is
known better and is still askew is let be.
"""

import math
from collections.abc import Sequence

import numpy as np

from companion.estimation.smoothing.factors import SQUARE_SIGMA_RAD, off_square_rad
from companion.estimation.smoothing.state import Array

WITHIN_SIGMAS = 3.0
WITHIN_RAD = math.radians(8)


def square_pairs(directions_rad: Sequence[Array], covariance: Array) -> tuple[tuple[int, int], ...]:
    """Walls that seem to be at a multiple of 90° to another, and that: the likeliest of the surer.

    Not all to one: the wings of a building may be askew. `directions_rad`, (w,) each, are as they
    were and as they are, whose covariance is (w, w). By any of them: what was square does not turn
    away because of hits that may be on something else.
    """
    own = np.diag(covariance)
    variance = own[:, None] + own - 2 * covariance
    sigma_rad = np.sqrt(np.maximum(variance, 0.0) + SQUARE_SIGMA_RAD**2)
    off_rad = [off_square_rad(told[:, None] - told) for told in directions_rad]
    least_off_rad = np.abs(off_rad).min(axis=0)
    may_be = least_off_rad < np.minimum(WITHIN_RAD, WITHIN_SIGMAS * sigma_rad)
    may_be &= own < own[:, None]
    likelihood = np.exp(-0.5 * (least_off_rad / sigma_rad) ** 2) / sigma_rad
    return tuple(
        (int(wall), int(np.where(may_be[wall], likelihood[wall], 0.0).argmax()))
        for wall in np.flatnonzero(may_be.any(axis=1))
    )

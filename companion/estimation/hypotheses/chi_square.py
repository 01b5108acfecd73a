"""How well a flight and its walls explain everything that was measured."""

import numpy as np

from companion.estimation.association.gating import UNEXPLAINED
from companion.estimation.smoothing.estimate import Estimate, MarginalPrior
from companion.estimation.smoothing.factors import hit_residuals
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import Array, Indices, Measured, Unknowns, project

WALL_COST = 60.0
"""χ² that a wall must save to be part of the likelier of two maps: it has two unknowns and two
ends, ln n each, and must hold against all lines that could have been put there."""
MIN_COS = 0.15
REACH_M = 0.2
"""A wall is there so far beyond its outermost hits."""


def cost(smoother: Smoother, estimate: Estimate, m: Measured, past: MarginalPrior) -> float:
    """χ² of all that was measured, robust against hits that fit nothing, and of its walls."""
    x, wall_of, units = estimate.x, estimate.wall_of, smoother.models.ranges
    on_walls = np.minimum(hit_residuals(x, m, wall_of, units) ** 2, UNEXPLAINED).sum()
    on_none = _explained(x, m, np.flatnonzero(wall_of == NO_WALL), units).sum()
    believed = past.belief.cost(past.beside(x))
    motion = smoother.motion(x, m).squares
    return motion + float(on_walls + on_none) + believed + WALL_COST * len(x.walls)


def _explained(x: Unknowns, m: Measured, hits: Indices, units: RangeUnits) -> Array:
    """(h,): χ² of hits that are on no wall, each by the wall that explains it best.

    Many of them did meet one, but so far or on such a slant that they must not pull at it.
    """
    seen = project(x, m)
    eyes, beams, beam = seen.eyes[hits], seen.beams[hits], m.beam[hits]
    distance_m = (1 - x.range_gain[beam]) * m.distance_m[hits]
    least = np.full(len(hits), UNEXPLAINED)
    for line, normal, tangent, reach_m in zip(
        x.walls, x.normals, x.tangents, x.reach_m, strict=True
    ):
        cos = beams @ normal
        ahead_m = (line[1] - eyes @ normal) / np.where(cos > MIN_COS, cos, np.inf)
        along_m = (eyes + ahead_m[:, None] * beams) @ tangent
        met = (ahead_m > 0) & (along_m > reach_m[0] - REACH_M) & (along_m < reach_m[1] + REACH_M)
        expected_m = np.minimum(ahead_m - m.mount_m[hits], units.max_m[beam])[met]
        misfit = units.signal(beam[met], distance_m[met]) - units.signal(beam[met], expected_m)
        least[met] = np.minimum(least[met], misfit**2)
    return least

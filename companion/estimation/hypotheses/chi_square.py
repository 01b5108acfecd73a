"""Computes the χ² of a solution over all measurements and walls."""

import numpy as np

from companion.core.arrays import Array, Indices
from companion.estimation.association.gating import UNEXPLAINED
from companion.estimation.association.see_through import passages
from companion.estimation.smoothing.estimate import Estimate, MarginalPrior
from companion.estimation.smoothing.factors import hit_residuals
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import Measured, Unknowns, project, unbiased_m

WALL_COST = 60.0
"""χ² that a wall must save to be part of the more likely map. Chosen: it has two unknowns and
two ends, ln n each, and competes with all other possible lines."""
MIN_COS = 0.15
"""Cosine of the largest incidence at which a wall can explain a hit. Chosen."""
BEYOND_END_M = 0.2
"""A wall explains hits this far beyond its outermost hits, m. Chosen."""


def cost(smoother: Smoother, estimate: Estimate, m: Measured, prior: MarginalPrior) -> float:
    """χ² of all measurements, robust against outliers, plus a cost per wall.

    A beam that passed through a wall counts as a hit that fits no wall.
    """
    x, wall_of = estimate.x, estimate.wall_of
    on_walls, on_none = hit_costs(smoother, x, m, wall_of)
    through = passage_costs(smoother, x, m, wall_of).sum()
    motion = smoother.motion(x, m).squares
    hits = float(on_walls.sum() + on_none.sum() + through)
    return motion + hits + prior.cost(x) + WALL_COST * len(x.walls)


def hit_costs(
    smoother: Smoother, x: Unknowns, m: Measured, wall_of: Indices
) -> tuple[Array, Array]:
    """χ² of the hits on walls, and of those without a wall, each in their order."""
    units = smoother.models.ranges
    on_walls = np.minimum(hit_residuals(x, m, wall_of, units) ** 2, UNEXPLAINED)
    return on_walls, _explained(x, m, np.flatnonzero(wall_of == NO_WALL), units)


def passage_costs(smoother: Smoother, x: Unknowns, m: Measured, wall_of: Indices) -> Array:
    """(w,): χ² of the beams that passed through each wall."""
    sigma_m = smoother.models.ranges.sigma_m(m.beam, m.distance_m)
    opening_m = smoother.support.opening_m
    beams = passages(x, project(x, m), sigma_m, wall_of, opening_m)
    return np.asarray(UNEXPLAINED * beams, dtype=np.float64)


def _explained(x: Unknowns, m: Measured, hits: Indices, units: RangeUnits) -> Array:
    """(h,): χ² of hits without a wall, each by the wall that explains it best.

    Many of these hits are on a wall, but at a range or incidence at which they must not influence
    it.
    """
    rays = project(x, m)
    origins, beams, beam = rays.origins[hits], rays.beams[hits], m.beam[hits]
    distance_m = unbiased_m(x, m)[hits]
    lowest = np.full(len(hits), UNEXPLAINED)
    for line, normal, tangent, reach_m in zip(
        x.walls, x.normals, x.tangents, x.reach_m, strict=True
    ):
        cos = beams @ normal
        ahead_m = (line[1] - origins @ normal) / np.where(cos > MIN_COS, cos, np.inf)
        along_m = (origins + ahead_m[:, None] * beams) @ tangent
        met = (
            (ahead_m > 0)
            & (along_m > reach_m[0] - BEYOND_END_M)
            & (along_m < reach_m[1] + BEYOND_END_M)
        )
        expected_m = np.minimum(ahead_m - m.mount_m[hits], units.max_m[beam])[met]
        misfit = units.signal(beam[met], distance_m[met]) - units.signal(beam[met], expected_m)
        lowest[met] = np.minimum(lowest[met], misfit**2)
    return lowest

"""Assigns each hit to a wall, in every round of the smoother with a narrower gate.

A wall stays if it is worth its two unknowns: if the hits would fit clearly worse without it, and
few beams passed through it. Duplicates are merged. Rows of noise beside a real wall are pruned, as
are pieces of wall that beams passed through. Hits beyond a step belong to another wall
(`steps.py`).
"""

from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Indices
from companion.estimation.association.gating import GATE_SIGMAS, Gate, candidates
from companion.estimation.association.merging import merge
from companion.estimation.association.pruning import (
    Support,
    one_wall_per_stretch,
    without_bends,
    without_distant_rows,
    without_isolated_hits,
    without_weak_walls,
)
from companion.estimation.association.see_through import passages, passed_through
from companion.estimation.association.steps import Steps
from companion.estimation.smoothing.odometry_model import OdometryModel
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import Measured, Unknowns, project, reach_m


@dataclass(frozen=True, slots=True)
class Association:
    """Associates hits with walls by the sensors' noise and the minimum support of a wall."""

    units: RangeUnits
    odometry: OdometryModel
    support: Support

    def associate(self, x: Unknowns, m: Measured, gate: Gate, known: int = 0) -> Indices:
        """(n,): each hit's wall or NO_WALL. Walls without sufficient support are removed from `x`.

        The first `known` walls always stay. The reach of all walls in `x` is updated.
        """
        rays = project(x, m)
        pairs = candidates(x, m, rays, self.units, gate)
        sigma_m = self.units.sigma_m(m.beam, m.distance_m)
        steps = Steps.of(x, m, rays, sigma_m, self.odometry)
        wide_m = sigma_m + gate.across_m / GATE_SIGMAS
        if merge(x, rays, wide_m, pairs.best(), steps, known=known):
            pairs = candidates(x, m, rays, self.units, gate)
        pairs = one_wall_per_stretch(x, rays, pairs)
        wall_of = pairs.best()
        pairs = pairs.without(steps.off_surface(wall_of, x.walls), wall_of)
        pairs = without_distant_rows(x, rays, pairs, self.support)
        pairs = without_isolated_hits(m, pairs)
        passed = np.zeros(len(x.walls), dtype=np.int64)
        if gate.prunes_see_through:
            pairs = without_bends(x, rays, sigma_m, pairs, known)
            wall_of = pairs.best()
            wrong = passed_through(x, rays, sigma_m, wall_of, self.support.opening_m)
            pairs = pairs.without(wrong, wall_of)
            passed = passages(x, rays, sigma_m, pairs.best(), self.support.opening_m)
        pairs, kept = without_weak_walls(
            x, rays, sigma_m, pairs, self.support, passed=passed, known=known
        )
        past_reach_m = x.reach_m[:known]
        wall_of = x.keep_walls(kept, pairs.best())
        x.reach_m = reach_m(x, rays.points, wall_of)
        x.reach_m[:known, 0] = np.minimum(x.reach_m[:known, 0], past_reach_m[:, 0])
        x.reach_m[:known, 1] = np.maximum(x.reach_m[:known, 1], past_reach_m[:, 1])
        return wall_of

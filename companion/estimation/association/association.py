"""Which hit belongs to which wall, and which walls there are.

Decided anew in every round of the smoother, with an ever narrower gate. A wall stays if it is
worth its two unknowns: if the hits would fit clearly worse without it. Walls that are one, and
rows of noise beside a real wall, are not; nor are pieces of wall through which beams went. What a
beam met beyond a step is on another wall (`steps.py`).
"""

from dataclasses import dataclass

import numpy as np

from companion.estimation.association.gating import GATE_SIGMAS, Gate, candidates
from companion.estimation.association.merging import merge
from companion.estimation.association.pruning import (
    Support,
    one_wall_a_stretch,
    without_bends,
    without_glimpses,
    without_strays,
    worthy,
)
from companion.estimation.association.see_through import refuted
from companion.estimation.association.steps import Steps
from companion.estimation.smoothing.odometry_model import OdometryModel
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import Indices, Measured, Unknowns, project, reach_m


@dataclass(frozen=True, slots=True)
class Association:
    """Gives hits to walls, by what is known of the sensors and what speaks for a wall."""

    units: RangeUnits
    odometry: OdometryModel
    support: Support

    def associate(self, x: Unknowns, m: Measured, gate: Gate, known: int = 0) -> Indices:
        """(n,): each hit's wall or NO_WALL, after walls without worth were taken out of `x`.

        The first `known` walls are there whatever these hits say. The reach of all is told anew.
        """
        seen = project(x, m)
        pairs = candidates(x, m, seen, self.units, gate)
        sigma_m = self.units.sigma_m(m.beam, m.distance_m)
        steps = Steps.of(x, m, seen, sigma_m, self.odometry)
        wide_m = sigma_m + gate.across_m / GATE_SIGMAS
        if merge(x, seen, wide_m, pairs.best(), steps, known=known):
            pairs = candidates(x, m, seen, self.units, gate)
        pairs = one_wall_a_stretch(x, seen, pairs)
        wall_of = pairs.best()
        pairs = pairs.without(steps.beside(wall_of, x.walls), wall_of)
        pairs = without_strays(x, seen, pairs, self.support)
        pairs = without_glimpses(m, pairs)
        if gate.refutes:
            pairs = without_bends(x, seen, sigma_m, pairs, known)
            wall_of = pairs.best()
            wrong = refuted(x, seen, sigma_m, wall_of, self.support.opening_m)
            pairs = pairs.without(wrong, wall_of)
        pairs, kept = worthy(x, seen, sigma_m, pairs, self.support, known=known)
        past = x.reach_m[:known]
        wall_of = x.keep_walls(kept, pairs.best())
        x.reach_m = reach_m(x, seen.points, wall_of)
        x.reach_m[:known, 0] = np.minimum(x.reach_m[:known, 0], past[:, 0])
        x.reach_m[:known, 1] = np.maximum(x.reach_m[:known, 1], past[:, 1])
        return wall_of

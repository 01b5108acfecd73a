"""Solves for walls along a path that is not corrected.

The equations are those of the smoother without the poses: each wall's line by its hits. With
odometry that drifts for an hour every wall exists many times. With all poses and hundreds of walls
the equations would need minutes and a GB.
"""

from companion.core.arrays import Array, Indices
from companion.estimation.smoothing import factors
from companion.estimation.smoothing.bordered_solver import BorderedSystem, Gradient
from companion.estimation.smoothing.estimate import MarginalPrior
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import POSE_SIZE, Measured, Unknowns


class OdometryPath(Smoother):
    """A smoother that detects and fits walls and keeps the poses."""

    def system(
        self, x: Unknowns, m: Measured, wall_of: Indices, prior: MarginalPrior
    ) -> BorderedSystem:
        """All equations; one dummy pose replaces the chain."""
        system = _OnlyShared(POSE_SIZE, x.calibration.size + x.walls.size, 2 * POSE_SIZE)
        factors.add_hits(system, x, m, wall_of, self.models.ranges)
        self.add_prior(system, x, prior)
        return system


class _OnlyShared(BorderedSystem):
    def add(
        self, residual: Array, sigma: Array | float, chained: Gradient, shared: Gradient = ()
    ) -> None:
        """Add residuals as if their poses were known."""
        super().add(residual, sigma, [], shared)

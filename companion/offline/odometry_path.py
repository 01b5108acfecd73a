"""Walls along a path that is taken as it was told: nothing but walls is solved for.

The equations are those of the smoother without the poses: a wall's line by the hits on it. Where
odometry drifts for an hour every wall is there many times, and with all poses beside hundreds of
walls the equations would need minutes and a GB.
"""

from companion.estimation.smoothing import factors
from companion.estimation.smoothing.bordered_solver import Array, BorderedSystem, Gradient
from companion.estimation.smoothing.estimate import MarginalPrior
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import POSE_SIZE, Indices, Measured, Unknowns


class OdometryPath(Smoother):
    """Finds walls, and leaves the poses where they are."""

    def system(
        self, x: Unknowns, m: Measured, wall_of: Indices, past: MarginalPrior
    ) -> BorderedSystem:
        """All equations; of the poses there is one, which stays for all of them."""
        system = _OnlyShared(POSE_SIZE, factors.WALLS + x.walls.size, 2 * POSE_SIZE)
        factors.add_hits(system, x, m, wall_of, self.models.ranges)
        self.add_prior(system, x, past)
        return system


class _OnlyShared(BorderedSystem):
    def add(
        self, residual: Array, sigma: Array | float, chained: Gradient, shared: Gradient = ()
    ) -> None:
        """As if the poses that a residual touches were known."""
        super().add(residual, sigma, [], shared)

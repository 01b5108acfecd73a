"""Result of the smoother, and its prior from the part of the flight before."""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.core.arrays import Array, Indices
from companion.core.frames import wrap_rad
from companion.core.messages import WallLine
from companion.estimation.smoothing.bordered_solver import Gaussian, Solution
from companion.estimation.smoothing.state import (
    CALIBRATION_SIZE,
    POSE_SIZE,
    WALL_SIZE,
    YAW,
    Unknowns,
    tangents_of,
    walls_moved_to,
)


@dataclass(frozen=True, slots=True)
class StartPrior:
    """Prior on the first keyframe of a later flight."""

    frame: int
    at: Array
    """(6,): a pose, as in `Unknowns.poses`."""
    sigma: Array
    """(6,)."""

    def difference(self, x: Unknowns) -> Array:
        """(6,): difference of `x` from it."""
        delta: Array = x.poses[self.frame] - self.at
        delta[YAW] = wrap_rad(delta[YAW])
        return delta


@dataclass(frozen=True, slots=True)
class EarlierWalls:
    """Walls of earlier flights as a prior for a new one, in the frame of the survey.

    It is the marginal of their joint solution: poses and calibrations are integrated out.
    """

    walls: Array
    """(w, 2): as in `Unknowns`."""
    reach_m: Array
    """(w, 2): as in `Unknowns`."""
    covariance: Array
    """(2w, 2w): of the walls."""
    start_sigma: Array
    """(3,): sigmas of the start: north, east, m, and heading, rad."""

    def moved_to(self, start: Array) -> "EarlierWalls":
        """The walls in another frame, in which that of the survey begins at `start` (3,).

        A wall's offset grows by n(θ)·s, so it also depends on the wall's direction θ: by t(θ)·s.
        """
        walls, reach_m = walls_moved_to(start, self.walls, self.reach_m)
        change = np.eye(walls.size)
        offset = np.arange(1, walls.size, WALL_SIZE)
        change[offset, offset - 1] = tangents_of(walls) @ start[:YAW]
        covariance = change @ self.covariance @ change.T
        return replace(self, walls=walls, reach_m=reach_m, covariance=covariance)


@dataclass(frozen=True, slots=True)
class MarginalPrior:
    """The measurements before one keyframe as a prior on it and on all shared unknowns."""

    frame: int
    at: Array
    """(pose + shared,): the prior's reference point."""
    gaussian: Gaussian
    flights: int = 1
    """Number of flights whose calibration it contains."""
    later: tuple[StartPrior, ...] = ()
    """Starts of the flights after the first."""

    @property
    def walls(self) -> int:
        """Number of walls in the prior."""
        return (len(self.at) - self._first_wall) // WALL_SIZE

    @property
    def _first_wall(self) -> int:
        return POSE_SIZE + CALIBRATION_SIZE * self.flights

    def cost(self, x: Unknowns) -> float:
        """χ² of `x`, up to a constant."""
        later = (((start.difference(x) / start.sigma) ** 2).sum() for start in self.later)
        return self.gaussian.cost(self.difference(x)) + float(sum(later))

    def difference(self, x: Unknowns) -> Array:
        """(pose + shared,): difference of `x` from the reference point."""
        delta: Array = values(x, 0)[: len(self.at)] - self.at
        angles = np.array([YAW, *range(self._first_wall, len(self.at), WALL_SIZE)])
        delta[angles] = wrap_rad(delta[angles])
        return delta


@dataclass(slots=True)
class Estimate:
    """The most likely solution from some keyframe on."""

    x: Unknowns
    wall_of: Indices
    solution: Solution

    @property
    def wall_lines(self) -> tuple[WallLine, ...]:
        """Walls with their sigmas at the anchor.

        Direction and offset are independent at cov(α, ρ) / var(α) along the wall.
        """
        lines = []
        for i, (normal_rad, offset_m) in enumerate(self.x.walls):
            at = self.x.calibration.size + WALL_SIZE * i
            block = self.solution.shared_covariance[at : at + 2, at : at + 2]
            (direction, both), (_, offset) = block
            lines.append(
                WallLine(
                    wrap_rad(float(normal_rad)),
                    float(offset_m),
                    math.sqrt(max(offset - both**2 / direction, 0.0)),
                    math.sqrt(direction),
                    float(both / direction),
                )
            )
        return tuple(lines)


def values(x: Unknowns, frame: int) -> Array:
    """(pose + shared,): one keyframe and the shared unknowns, in the order of the equations."""
    return np.concatenate([x.poses[frame], x.calibration.ravel(), x.walls.ravel()])

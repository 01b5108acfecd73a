"""One flight of a joint solution, with the measurements of all others as a prior on the walls.

An alternative changes one flight. Solved over all flights it would take as many times longer as
there are flights. The normal equations of the shared unknowns are a sum over the flights,

    S = S_1 + ... + S_n        (`bordered_solver.py`, poses integrated out)

so the others are S less the flight's own part, with their calibrations integrated out. About the
present solution this prior is exact.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from companion.core.arrays import Array, Indices, Mask
from companion.estimation.hypotheses.chi_square import cost
from companion.estimation.smoothing.bordered_solver import Gaussian
from companion.estimation.smoothing.estimate import Estimate, MarginalPrior, values
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import CALIBRATION_SIZE, POSE_SIZE, Measured, Unknowns

OWN = POSE_SIZE + CALIBRATION_SIZE
"""Unknowns of a flight in its prior: the first pose and the calibration."""


@dataclass(frozen=True, slots=True)
class OneFlight:
    """A flight of a joint solution; its walls are all walls of the map, in the same order."""

    number: int
    frames: slice
    hits: slice
    """Its part of all keyframes and of all hits."""
    m: Measured
    prior: MarginalPrior
    estimate: Estimate
    cost: float
    strain: float
    """χ² of its present solution: of all, and of odometry and gyro alone."""

    def of(self, x: Unknowns) -> Unknowns:
        """Its part of unknowns of all flights, as a copy."""
        return _own(x, self.number, self.frames)

    def put_into(self, x: Unknowns, own: Unknowns) -> Unknowns:
        """Unknowns of all flights with those of this one, and with its walls."""
        joint = x.since(0)
        joint.poses[self.frames] = own.poses
        joint.calibration[self.number] = own.calibration[0]
        joint.walls, joint.reach_m = own.walls.copy(), own.reach_m.copy()
        return joint


class Flights:
    """The flights of a solution, each alone."""

    def __init__(
        self, smoother: Smoother, estimate: Estimate, m: Measured, prior: MarginalPrior
    ) -> None:
        self._smoother, self.estimate, self._m, self._prior = smoother, estimate, m, prior
        self._shared: tuple[Array, Array] | None = None
        self._made: dict[int, OneFlight] = {}

    def with_frames(self, frames: Mask) -> OneFlight:
        """The flight with most of the masked keyframes (k,)."""
        return self._flight(int(np.bincount(self._m.flight[frames], minlength=1).argmax()))

    def with_hit(self, hit: int) -> OneFlight:
        """The flight of a hit."""
        return self._flight(int(self._m.hit_flight[hit]))

    def _flight(self, number: int) -> OneFlight:
        if number not in self._made:
            self._made[number] = self._make(number)
        return self._made[number]

    def _make(self, number: int) -> OneFlight:
        m, x, wall_of = self._m, self.estimate.x, self.estimate.wall_of
        begin, end = (*m.begins, len(x.poses))[number : number + 2]
        frames, hits = slice(begin, end), slice(m.first_hit(begin), m.first_hit(end))
        if len(m.begins) == 1:
            part, prior, estimate = m, self._prior, self.estimate
        else:
            part, own = m.between(begin, end), _own(x, number, frames)
            estimate = Estimate(own, wall_of[hits], self.estimate.solution)
            prior = self._prior_of(number, estimate, part)
        at_present = cost(self._smoother, estimate, part, prior)
        strain = self._smoother.motion(estimate.x, part).squares
        return OneFlight(number, frames, hits, part, prior, estimate, at_present, strain)

    def _prior_of(self, number: int, estimate: Estimate, part: Measured) -> MarginalPrior:
        """The prior on its start and calibration, and what the others say of the walls."""
        own = estimate.x
        start = self._own_prior(number, own)
        walls = self._by_others(number, estimate, part, start)
        known = Gaussian(
            block_diag(start.gaussian.information, walls.information),
            np.concatenate([start.gaussian.gradient, walls.gradient]),
        )
        return MarginalPrior(0, values(own, 0), known)

    def _own_prior(self, number: int, own: Unknowns) -> MarginalPrior:
        """The prior on its first pose and its calibration, about their present values."""
        every = self._prior.gaussian.moved(self._prior.difference(self.estimate.x))
        at = POSE_SIZE + CALIBRATION_SIZE * number + np.arange(CALIBRATION_SIZE)
        calibration = Gaussian(every.information[np.ix_(at, at)], every.gradient[at])
        if number == 0:
            pose = Gaussian(every.information[:POSE_SIZE, :POSE_SIZE], every.gradient[:POSE_SIZE])
        else:
            start = self._prior.later[number - 1]
            weight = start.sigma**-2.0
            pose = Gaussian(np.diag(weight), weight * start.difference(self.estimate.x))
        both = Gaussian(
            block_diag(pose.information, calibration.information),
            np.concatenate([pose.gradient, calibration.gradient]),
        )
        return MarginalPrior(0, values(own, 0)[:OWN], both)

    def _by_others(
        self, number: int, estimate: Estimate, m: Measured, start: MarginalPrior
    ) -> Gaussian:
        """What all other flights say of the walls, about their present values."""
        if self._shared is None:
            x, wall_of = self.estimate.x, self.estimate.wall_of
            self._shared = self._smoother.system(x, self._m, wall_of, self._prior).of_shared()
        information, gradient = (each.copy() for each in self._shared)
        own_information, own_gradient = self._smoother.system(
            estimate.x, m, estimate.wall_of, start
        ).of_shared()
        calibrations = CALIBRATION_SIZE * len(self._m.begins)
        walls: Indices = np.arange(calibrations, len(gradient))
        own_calibration = CALIBRATION_SIZE * number + np.arange(CALIBRATION_SIZE)
        at = np.concatenate([own_calibration, walls])
        information[np.ix_(at, at)] -= own_information
        gradient[at] -= own_gradient
        others = np.setdiff1d(np.arange(calibrations), own_calibration)
        coupling = information[np.ix_(walls, others)]
        response = coupling @ np.linalg.inv(information[np.ix_(others, others)])
        return Gaussian(
            information[np.ix_(walls, walls)] - response @ coupling.T,
            gradient[walls] - response @ gradient[others],
        )


def _own(x: Unknowns, number: int, frames: slice) -> Unknowns:
    copy = x.since(0)
    return replace(copy, poses=copy.poses[frames], calibration=copy.calibration[[number]])

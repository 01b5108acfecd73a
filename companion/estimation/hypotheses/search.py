"""Where odometry or the gyro speak against what the walls made of the flight.

Hits on a wrong wall pull the trajectory aside, and then fit well. But from one moment to another
the drone has not moved like that, nor has the bias of its gyro. So what the beams met in a doubtful
stretch is forgotten, the trajectory bridged by odometry, and the hits given to walls from there, by
narrow gates:

    as the walls have it       ●──●╮        ╭●──●
                                    ●──●──●
    bridged by odometry        ●──●──●──●──●──●──●

And what pulls at a wall that was met again may have met another (`split_revisits.py`): it is given
a wall of its own for once. Whole stretches may lie beside the map (`shift_stretches.py`): they are
shifted.

Whichever explains all measurements better is kept: it may be odometry that was wrong.
"""

import itertools
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.estimation.association.gating import Gate
from companion.estimation.hypotheses.chi_square import cost
from companion.estimation.hypotheses.shift_stretches import Shift, shifted, shifts
from companion.estimation.hypotheses.split_revisits import apart, doubting
from companion.estimation.smoothing.estimate import Estimate, MarginalPrior
from companion.estimation.smoothing.factors import Models, wander_steps_m
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.odometry_model import OdometryModel
from companion.estimation.smoothing.smoother import WHOLE, Smoother
from companion.estimation.smoothing.state import (
    BIAS,
    YAW,
    Array,
    Indices,
    Measured,
    Unknowns,
    to_ned,
)

Mask = NDArray[np.bool_]

SPANS_S = (2.0, 4.0, 8.0, 16.0)
"""Of long ones only those in which no shorter one shows where it was."""
SIGMAS = 3.0
TOGETHER_S = 30.0
"""What lies between two such moments no farther apart was pulled aside by the first and let go at
the second."""
MAX_RECONSIDERED = 3
MAX_SHIFTED = 8
MAX_TRIED = 4
BRIDGING_STEPS = 2
BRIDGED_GATES = (Gate(0.05, 0.4, looks=WHOLE, refutes=True),) * 3
STRETCHES_S = (180.0, 90.0, 45.0)
"""The long ones first: a short one, all else as it was, is led back to where it was."""
MAX_STRETCHES = 4
"""The most strained ones are tried; each needs about as long as smoothing the flight."""
MIN_GAIN = 40.0
"""χ² by which another flight must be likelier to be worth looking further from there."""


@dataclass(frozen=True, slots=True)
class Doubt:
    """Looks for a likelier flight, in pieces of some milliseconds."""

    smoother: Smoother
    m: Measured
    past: MarginalPrior
    gates: Sequence[Gate]

    def reconsidering(self, estimate: Estimate) -> Generator[None, None, Estimate]:
        """Where odometry or the gyro contradict this one, and in walls that were met again."""
        for _ in range(MAX_RECONSIDERED):
            doubted = contradicted(estimate.x, self.m, self.smoother.models)
            if not doubted.any():
                break
            other = yield from self._without(doubted, estimate)
            if self._cost(other) >= self._cost(estimate):
                break
            estimate = other
        return (yield from self._revisiting(estimate))

    def searching(self, estimate: Estimate) -> Generator[None, None, Estimate]:
        """In stretches beside the map, walls that were met again, and what strains odometry most.

        For when the flight is over, and there is time.
        """
        estimate = yield from self._shifting(estimate)
        estimate = yield from self._revisiting(estimate)
        tried: set[bytes] = set()
        for length_s in STRETCHES_S:
            estimate = yield from self._straining(length_s, estimate, tried)
        return estimate

    def _straining(
        self, length_s: float, estimate: Estimate, tried: set[bytes]
    ) -> Generator[None, None, Estimate]:
        """In the stretches of one length that strain odometry most.

        `tried` are those without which this estimate is no likelier: in a short flight stretches of
        several lengths are the same.
        """
        for _ in range(MAX_RECONSIDERED):
            odometry = self.smoother.models.odometry
            worst = {s.tobytes(): s for s in strained(estimate.x, self.m, odometry, length_s)}
            stretches = {key: stretch for key, stretch in worst.items() if key not in tried}
            others = (self._without(doubted, estimate) for doubted in stretches.values())
            likelier = yield from self._likelier(others, estimate, MIN_GAIN)
            if likelier is None:
                tried |= stretches.keys()
                break
            estimate = likelier
            tried.clear()
        return estimate

    def _shifting(self, estimate: Estimate) -> Generator[None, None, Estimate]:
        """Where a stretch would lie on what was met before and after it."""
        for _ in range(MAX_SHIFTED):
            found = yield from shifts(estimate, self.m, self.smoother.models.ranges)
            others = (self._shifted(shift, estimate) for shift in found[:MAX_TRIED])
            likelier = yield from self._likelier(others, estimate)
            if likelier is None:
                break
            estimate = likelier
        return estimate

    def _revisiting(self, estimate: Estimate) -> Generator[None, None, Estimate]:
        """Where what was met again may have been another wall."""
        for _ in range(MAX_RECONSIDERED):
            visits = yield from doubting(self.smoother, estimate, self.m, self.past)
            others = (self._apart(hits, estimate) for hits in visits[:MAX_TRIED])
            likelier = yield from self._likelier(others, estimate)
            if likelier is None:
                break
            estimate = likelier
        return estimate

    def _likelier(
        self,
        others: Iterable[Generator[None, None, Estimate]],
        estimate: Estimate,
        gain: float = 0.0,
    ) -> Generator[None, None, Estimate | None]:
        """The first of other flights that is likelier, by more χ² than that; None if none is."""
        likely = self._cost(estimate) - gain
        for work in others:
            other = yield from work
            if self._cost(other) < likely:
                return other
        return None

    def _cost(self, estimate: Estimate) -> float:
        return cost(self.smoother, estimate, self.m, self.past)

    def _without(self, doubted: Mask, estimate: Estimate) -> Generator[None, None, Estimate]:
        """The flight with what was met at some keyframes (k,) given to walls anew."""
        x, wall_of = estimate.x.since(0), np.where(doubted[self.m.frame], NO_WALL, estimate.wall_of)
        for _ in range(BRIDGING_STEPS):
            self.smoother.step(x, self.m, wall_of, self.past)
            yield
        return (yield from self.smoother.smoothing(x, self.m, self.past, BRIDGED_GATES))

    def _shifted(self, shift: Shift, estimate: Estimate) -> Generator[None, None, Estimate]:
        """The flight with a stretch where it would fit better."""
        x = shifted(estimate.x, self.m, shift)
        return (yield from self.smoother.smoothing(x, self.m, self.past, BRIDGED_GATES))

    def _apart(self, hits: Indices, estimate: Estimate) -> Generator[None, None, Estimate]:
        """The flight with some hits of a wall on one of their own."""
        other = apart(estimate, [hits])
        for _ in range(BRIDGING_STEPS):
            self.smoother.step(other.x, self.m, other.wall_of, self.past)
            yield
        narrow = [gate for gate in self.gates if gate.refutes]
        return (yield from self.smoother.smoothing(other.x, self.m, self.past, narrow))


def strained(x: Unknowns, m: Measured, model: OdometryModel, length_s: float) -> list[Mask]:
    """The stretches (k,) so long that strain odometry most, the worst first.

    By the χ² of its steps: what walls that are right do to it is about the same everywhere. Each
    half overlaps the next.
    """
    time_s = m.time_s
    walk_m = np.diff(x.tracks, axis=0) - _by_odometry_m(x, m)
    square = (walk_m**2).sum(axis=1) / model.step_sigma_m(m.dt_s) ** 2
    square += (wander_steps_m(x, m) ** 2).sum(axis=1) / model.wander_step_sigma_m(m.dt_s) ** 2
    total = _from_first(square)
    begin_s = np.arange(-length_s / 2, time_s[-1], length_s / 2)
    begin, end = np.searchsorted(time_s, [begin_s, begin_s + length_s])
    end = np.minimum(end, len(total) - 1)
    worst = np.argsort(total[begin] - total[end], kind="stable")[:MAX_STRETCHES]
    frames = np.arange(len(time_s))
    return [(frames >= begin[i]) & (frames < end[i]) for i in worst]


def contradicted(x: Unknowns, m: Measured, models: Models) -> Mask:
    """(k,): the keyframes about which odometry or the gyro say something else.

    Along a wall that steps back by the depth of a pilaster the heading would turn, and odometry
    hardly notice; but a bias does not move like that.
    """
    time_s = m.time_s
    strain_m = np.zeros((len(time_s), 2))
    strain_m[1:] = np.cumsum(np.diff(x.poses[:, :YAW], axis=0) - _by_odometry_m(x, m), axis=0)
    strain = np.column_stack([strain_m, x.poses[:, BIAS] - _from_first(m.bias_moved_rad_s)])
    walk_m2 = _from_first(models.odometry.step_sigma_m(m.dt_s) ** 2)
    variance = np.column_stack([walk_m2, walk_m2, _from_first(models.bias_variance(m))])
    wandered_m2 = 2 * models.odometry.wander_m**2
    against = np.zeros(len(time_s), dtype=bool)
    for span_s in SPANS_S:
        begin = np.arange(np.searchsorted(time_s, time_s[-1] - span_s, side="right"))
        end = np.searchsorted(time_s, time_s[begin] + span_s)
        strained = np.abs(strain[end] - strain[begin])
        sigma = np.sqrt(variance[end] - variance[begin] + (wandered_m2, wandered_m2, 0.0))
        known = against.copy()
        for wrong in np.flatnonzero((strained > SIGMAS * sigma).any(axis=1)):
            span = slice(begin[wrong], end[wrong] + 1)
            against[span] |= not known[span].any()
    at = np.flatnonzero(against)
    for before, after in itertools.pairwise(at):
        against[before:after] |= time_s[after] - time_s[before] < TOGETHER_S
    return against


def _by_odometry_m(x: Unknowns, m: Measured) -> Array:
    """(k - 1, 2): north and east from keyframe to keyframe as odometry tells."""
    return to_ned((1 + x.odometry_scale) * m.moved_frd_m, x.poses[:-1, YAW])


def _from_first(steps: Array) -> Array:
    """(k,): the steps (k - 1,) added up from the first keyframe to each."""
    return np.concatenate([[0.0], np.cumsum(steps)])

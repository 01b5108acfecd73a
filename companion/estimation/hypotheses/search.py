"""Searches alternative associations where odometry or gyro residuals contradict the solution.

Hits on a wrong wall shift the trajectory and then have small residuals. But the shift contradicts
the odometry or the gyro's bias. Therefore the hits of a contradicted stretch are removed, odometry
bridges the stretch, and the hits are associated again with narrow gates:

    by the walls               ●──●╮        ╭●──●
                                    ●──●──●
    bridged by odometry        ●──●──●──●──●──●──●

A repeated visit to a wall may belong to another wall (`split_revisits.py`): it gets its own wall. A
whole stretch may be offset from the map (`shift_stretches.py`): it is shifted.

After the flight an alternative is first solved alone: only the hits of its stretch are associated
again, the rest of the map stays. Of several flights only its own is solved (`one_flight.py`). Only
if it then explains all measurements better are all hits associated again, and it is kept only if it
still does, without the walls that it no longer needs (`fewer_walls.py`). The odometry may be the
wrong one.
"""

import itertools
import math
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.estimation.association.gating import Gate
from companion.estimation.hypotheses.chi_square import WALL_COST, cost
from companion.estimation.hypotheses.fewer_walls import with_fewer_walls
from companion.estimation.hypotheses.one_flight import Flights, OneFlight
from companion.estimation.hypotheses.shift_stretches import Shift, shifted, shifts
from companion.estimation.hypotheses.split_revisits import split, split_candidates
from companion.estimation.smoothing.estimate import Estimate, MarginalPrior
from companion.estimation.smoothing.factors import Models, wander_steps_m
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.odometry_model import OdometryModel
from companion.estimation.smoothing.smoother import FINAL_GATES, WHOLE, Smoother, run_to_end
from companion.estimation.smoothing.state import BIAS, YAW, Measured, Unknowns, by_odometry_m

SPANS_S = (2.0, 4.0, 8.0, 16.0)
"""Time spans over which residuals are summed, s. Longer spans count only where no shorter span
shows a contradiction. Chosen."""
MAX_SIGMAS = 3.0
"""Largest consistent residual over a span, in sigmas. Chosen."""
MAX_PAUSE_S = 30.0
"""Contradictions with a shorter pause form one stretch, s: the trajectory leaves its place at the
first and returns at the second. Chosen."""
MAX_ROUNDS = 3
"""Most rounds of each kind of search. Chosen."""
MAX_SHIFTS = 8
"""Most shifts in one search. Chosen."""
MAX_TRIED = 4
"""Most alternatives solved in one round. Chosen."""
BRIDGING_STEPS = 2
"""Gauss-Newton steps after a change of the association. Chosen."""
BRIDGED_GATES = (Gate(0.05, 0.4, detect_keyframes=WHOLE, prunes_see_through=True),) * 3
"""Gates of the association after a change. Chosen: odometry is this exact over some seconds."""
STRETCHES_S = (180.0, 90.0, 45.0)
"""Lengths of the stretches tried after the flight, s. Chosen. Long ones come first: a short stretch
between wrong neighbours returns to its old place."""
MAX_STRETCHES = 4
"""Stretches of one length that are tried, the most strained first. Chosen."""
MIN_RELIEF = 40.0
"""χ² of odometry and gyro that an alternative for a strained stretch must save. Chosen: else hits
that fitted no wall before, and now fit a new one, would count as relief."""


@dataclass(frozen=True, slots=True)
class Alternative:
    """A changed association, solved while all other hits keep their walls."""

    x: Unknowns
    """Unknowns of all flights."""
    gates: Sequence[Gate]
    """Gates of the association of all hits that follows."""
    saved: float
    """χ² that it saves, or that the association of all hits may save."""


@dataclass(frozen=True, slots=True)
class HypothesisSearch:
    """Searches for a more likely solution, in pieces of some milliseconds."""

    smoother: Smoother
    m: Measured
    prior: MarginalPrior
    gates: Sequence[Gate]

    def in_flight_search(self, estimate: Estimate) -> Generator[None, None, Estimate]:
        """Search contradicted stretches and repeated visits."""
        for _ in range(MAX_ROUNDS):
            suspect = contradicted(estimate.x, self.m, self.smoother.models)
            if not suspect.any():
                break
            x, _ = yield from self._released(suspect, estimate)
            alternative = yield from self.smoother.smoothing(x, self.m, self.prior, BRIDGED_GATES)
            if self._cost(alternative) >= self._cost(estimate):
                break
            estimate = alternative
        return (yield from self._search_revisits(estimate))

    def final_search(self, estimate: Estimate) -> Generator[None, None, Estimate]:
        """Search offset stretches, repeated visits, and the stretches that strain odometry most.

        It runs after the flight. `estimate` has settled with the same gates.
        """
        before = estimate
        estimate = yield from self._with_fewer_walls(estimate)
        estimate = yield from self._search_shifts(estimate)
        estimate = yield from self._search_revisits(estimate)
        tried: set[bytes] = set()
        for length_s in STRETCHES_S:
            estimate = yield from self._search_strained(length_s, estimate, tried)
        if estimate is before:
            return estimate
        again = yield from settled(
            self.smoother, estimate.x.since(0), self.m, self.prior, self._narrow_gates
        )
        return min(estimate, again, key=self._cost)

    @property
    def _narrow_gates(self) -> list[Gate]:
        return [gate for gate in self.gates if gate.prunes_see_through]

    def _search_strained(
        self, length_s: float, estimate: Estimate, tried: set[bytes]
    ) -> Generator[None, None, Estimate]:
        """Search the stretches of one length that strain odometry most.

        `tried`: stretches whose alternatives were not more likely. In a short flight stretches of
        several lengths coincide.
        """
        for _ in range(MAX_ROUNDS):
            odometry = self.smoother.models.odometry
            worst = {s.tobytes(): s for s in strained(estimate.x, self.m, odometry, length_s)}
            stretches = {key: stretch for key, stretch in worst.items() if key not in tried}
            flights = self._flights(estimate)
            alternatives = (self._bridged(suspect, flights) for suspect in stretches.values())
            likelier = yield from self._likelier(alternatives, estimate)
            if likelier is None:
                tried.update(stretches)
                break
            estimate = likelier
            tried.clear()
        return estimate

    def _search_shifts(self, estimate: Estimate) -> Generator[None, None, Estimate]:
        """Search stretches that would fit the hits before and after them better elsewhere."""
        for _ in range(MAX_SHIFTS):
            found = yield from shifts(estimate, self.m, self.smoother.models.ranges)
            flights = self._flights(estimate)
            alternatives = (self._shifted(shift, flights) for shift in found[:MAX_TRIED])
            likelier = yield from self._likelier(alternatives, estimate)
            if likelier is None:
                break
            estimate = likelier
        return estimate

    def _search_revisits(self, estimate: Estimate) -> Generator[None, None, Estimate]:
        """Search repeated visits that may belong to another wall."""
        for _ in range(MAX_ROUNDS):
            visits = yield from split_candidates(self.smoother, estimate, self.m, self.prior)
            flights = self._flights(estimate)
            alternatives = (self._split(hits, flights) for hits in visits[:MAX_TRIED])
            likelier = yield from self._likelier(alternatives, estimate)
            if likelier is None:
                break
            estimate = likelier
        return estimate

    def _likelier(
        self,
        alternatives: Iterable[Generator[None, None, Alternative | None]],
        estimate: Estimate,
    ) -> Generator[None, None, Estimate | None]:
        """The first alternative with a lower χ²; None if there is none."""
        for work in alternatives:
            alternative = yield from work
            if alternative is None or alternative.saved <= 0:
                continue
            again = yield from self.smoother.smoothing(
                alternative.x, self.m, self.prior, alternative.gates
            )
            again = yield from self._with_fewer_walls(again)
            if self._cost(again) < self._cost(estimate):
                return again
        return None

    def _with_fewer_walls(self, estimate: Estimate) -> Generator[None, None, Estimate]:
        return with_fewer_walls(self.smoother, estimate, self.m, self.prior)

    def _strain(self, x: Unknowns) -> float:
        """χ² of odometry and gyro."""
        return self.smoother.motion(x, self.m).squares

    def _cost(self, estimate: Estimate) -> float:
        return cost(self.smoother, estimate, self.m, self.prior)

    def _flights(self, estimate: Estimate) -> Flights:
        return Flights(self.smoother, estimate, self.m, self.prior)

    def _of(self, flight: OneFlight) -> "HypothesisSearch":
        """The search in one flight."""
        return replace(self, m=flight.m, prior=flight.prior)

    def _weighed(
        self, joint: Estimate, flight: OneFlight, alone: Estimate, gates: Sequence[Gate]
    ) -> Alternative:
        """An alternative of one flight."""
        saved = flight.cost - self._of(flight)._cost(alone)
        return Alternative(flight.put_into(joint.x, alone.x), gates, saved)

    def _bridged(
        self, suspect: Mask, flights: Flights
    ) -> Generator[None, None, Alternative | None]:
        """Odometry bridges the masked keyframes (k,); then their hits are associated again.

        Returns None if that does not relieve odometry and gyro by `MIN_RELIEF`.
        """
        flight = flights.with_frames(suspect)
        one, own = self._of(flight), suspect[flight.frames]
        x, wall_of = yield from one._released(own, flight.estimate)
        max_strain = flight.strain - MIN_RELIEF
        alone = yield from one._reassociated(x, wall_of, own, max_strain)
        if alone is None:
            return None
        return self._weighed(flights.estimate, flight, alone, BRIDGED_GATES)

    def _released(
        self, suspect: Mask, estimate: Estimate
    ) -> Generator[None, None, tuple[Unknowns, Indices]]:
        """The solution without the hits of the masked keyframes (k,): odometry bridges them."""
        x, wall_of = estimate.x.since(0), np.where(suspect[self.m.frame], NO_WALL, estimate.wall_of)
        yield from self._stepped(x, wall_of)
        return x, wall_of

    def _stepped(self, x: Unknowns, wall_of: Indices) -> Generator[None, None, None]:
        """Let `x` follow a changed association."""
        for _ in range(BRIDGING_STEPS):
            self.smoother.step(x, self.m, wall_of, self.prior)
            yield

    def _shifted(self, shift: Shift, flights: Flights) -> Generator[None, None, Alternative | None]:
        """A stretch is shifted; then its hits are associated again."""
        suspect = (self.m.time_s >= shift.begin_s) & (self.m.time_s < shift.end_s)
        flight = flights.with_frames(suspect)
        x = flight.of(shifted(flights.estimate.x, self.m, shift))
        alone = yield from self._of(flight)._reassociated(
            x, flight.estimate.wall_of, suspect[flight.frames]
        )
        if alone is None:
            return None
        return self._weighed(flights.estimate, flight, alone, BRIDGED_GATES)

    def _split(self, hits: Indices, flights: Flights) -> Generator[None, None, Alternative]:
        """Some hits of a wall get a wall of their own.

        That wall may coincide with another, and is then merged with it.
        """
        flight = flights.with_hit(int(hits[0]))
        own = hits[(hits >= flight.hits.start) & (hits < flight.hits.stop)] - flight.hits.start
        alone = split(flight.estimate, [own])
        yield from self._of(flight)._stepped(alone.x, alone.wall_of)
        alternative = self._weighed(flights.estimate, flight, alone, self._narrow_gates)
        return replace(alternative, saved=alternative.saved + WALL_COST)

    def _reassociated(
        self, x: Unknowns, wall_of: Indices, suspect: Mask, max_strain: float = math.inf
    ) -> Generator[None, None, Estimate | None]:
        """Associate the hits of the masked keyframes (k,) again; others keep their walls.

        Returns None as soon as χ² of odometry and gyro exceeds `max_strain`: each round finds walls
        for more hits, and strains them more.
        """
        hits = suspect[self.m.frame]
        part, wall_of = self.m.with_hits(hits), wall_of.copy()
        for gate in BRIDGED_GATES:
            known = len(x.walls)
            wall_of[hits] = yield from self.smoother.associated(x, part, gate, known)
            used = np.unique(np.concatenate([np.arange(self.prior.walls), wall_of[wall_of >= 0]]))
            wall_of = x.keep_walls(used, wall_of)
            solution = self.smoother.step(x, self.m, wall_of, self.prior)
            yield
            if self._strain(x) > max_strain:
                return None
        return Estimate(x, wall_of, solution)


def most_likely(smoother: Smoother, x: Unknowns, m: Measured, prior: MarginalPrior) -> Estimate:
    """Solve whole flights after landing: smooth them, then search for a more likely solution.

    `x` is the initial value.
    """
    estimate = run_to_end(settled(smoother, x, m, prior, FINAL_GATES))
    return run_to_end(HypothesisSearch(smoother, m, prior, FINAL_GATES).final_search(estimate))


def settled(
    smoother: Smoother, x: Unknowns, m: Measured, prior: MarginalPrior, gates: Sequence[Gate]
) -> Generator[None, None, Estimate]:
    """Smooth with all gates; the most likely solution of the rounds with the last one.

    With the same gate the association may alternate: a wall is dropped in one round, and detected
    again in the next. `x` is the initial value.
    """
    last = len(gates) - gates.count(gates[-1])
    if last:
        yield from smoother.smoothing(x, m, prior, gates[:last])
    rounds: list[Estimate] = []
    for gate in gates[last:]:
        estimate = yield from smoother.smoothing(x, m, prior, (gate,))
        rounds.append(Estimate(x.since(0), estimate.wall_of, estimate.solution))
    return min(rounds, key=lambda estimate: cost(smoother, estimate, m, prior))


def strained(x: Unknowns, m: Measured, model: OdometryModel, length_s: float) -> list[Mask]:
    """Masks (k,) of the stretches of this length that strain odometry most, the worst first.

    The measure is the χ² of the odometry steps, which is nearly uniform with correct associations.
    Stretches overlap by half.
    """
    time_s = m.time_s
    walk_m = np.diff(x.tracks, axis=0) - by_odometry_m(x, m)
    square = (walk_m**2).sum(axis=1) / model.step_sigma_m(m.dt_s) ** 2
    square += (wander_steps_m(x, m) ** 2).sum(axis=1) / model.wander_step_sigma_m(m.dt_s) ** 2
    within_flights = np.zeros_like(square)
    within_flights[m.moves] = square[m.moves]
    total = _from_first(within_flights)
    begin_s = np.arange(-length_s / 2, time_s[-1], length_s / 2)
    begin, end = np.searchsorted(time_s, [begin_s, begin_s + length_s])
    end = np.minimum(end, len(total) - 1)
    worst = np.argsort(total[begin] - total[end], kind="stable")[:MAX_STRETCHES]
    frames = np.arange(len(time_s))
    return [(frames >= begin[i]) & (frames < end[i]) for i in worst]


def contradicted(x: Unknowns, m: Measured, models: Models) -> Mask:
    """(k,): keyframes at which odometry or gyro residuals contradict the trajectory.

    Along a wall with pilasters taken for one surface the heading turns with small odometry
    residuals. The gyro's bias cannot change like that.
    """
    time_s = m.time_s
    strain_m = np.zeros((len(time_s), 2))
    strain_m[1:] = np.cumsum(np.diff(x.poses[:, :YAW], axis=0) - by_odometry_m(x, m), axis=0)
    strain = np.column_stack([strain_m, x.poses[:, BIAS] - _from_first(m.bias_moved_rad_s)])
    walk_m2 = _from_first(models.odometry.step_sigma_m(m.dt_s) ** 2)
    variance = np.column_stack([walk_m2, walk_m2, _from_first(models.bias_variance(m))])
    wandered_m2 = 2 * models.odometry.wander_m**2
    is_contradicted = np.zeros(len(time_s), dtype=bool)
    for span_s in SPANS_S:
        begin = np.arange(np.searchsorted(time_s, time_s[-1] - span_s, side="right"))
        end = np.searchsorted(time_s, time_s[begin] + span_s)
        strained = np.abs(strain[end] - strain[begin])
        sigma = np.sqrt(variance[end] - variance[begin] + (wandered_m2, wandered_m2, 0.0))
        known = is_contradicted.copy()
        for wrong in np.flatnonzero((strained > MAX_SIGMAS * sigma).any(axis=1)):
            span = slice(begin[wrong], end[wrong] + 1)
            is_contradicted[span] |= not known[span].any()
    at = np.flatnonzero(is_contradicted)
    for before, after in itertools.pairwise(at):
        is_contradicted[before:after] |= time_s[after] - time_s[before] < MAX_PAUSE_S
    return is_contradicted


def _from_first(steps: Array) -> Array:
    """(k,): sum of the steps (k - 1,) from the first keyframe to each."""
    return np.concatenate([[0.0], np.cumsum(steps)])

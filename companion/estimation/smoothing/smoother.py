"""The whole flight at once: the trajectory and walls that all measurements together make likeliest.

The filters must decide at every moment; a wall seen early can be set right by what was seen late.
Unknowns (`state.py`), solved together by Gauss-Newton (`factors.py`, `bordered_solver.py`):

    keyframes k: position p_k, heading ψ_k, gyro bias b_k, wander of the odometry w_k
    gyro scale g, odometry scale s, gain error γ of each range unit
    walls i: direction of the normal α_i, offset ρ_i           wall i: {p : p·n(α_i) = ρ_i}

Which hit belongs to which wall is decided anew in every round, with an ever narrower gate
(`association.py`). A Cauchy weight keeps what still does not fit from pulling. Of a long flight
its last part can be solved alone, with what came before as a belief about its first pose and all
that is shared.
"""

from collections.abc import Generator, Sequence

import numpy as np

from companion.estimation.association.association import Association
from companion.estimation.association.gating import Gate
from companion.estimation.association.hough import Cloud, detect_walls
from companion.estimation.association.pruning import Support
from companion.estimation.association.right_angles import square_pairs
from companion.estimation.smoothing import factors
from companion.estimation.smoothing.bordered_solver import Belief, BorderedSystem, Solution
from companion.estimation.smoothing.estimate import Estimate, MarginalPrior, values
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.state import (
    POSE_SIZE,
    WALL_SIZE,
    Array,
    Indices,
    Measured,
    Unknowns,
    project,
)

UNKNOWN_SIGMA = 100.0
"""Of a wall, metres and radians: nothing is known, but the equations stay solvable."""
WHOLE = 1_000_000
FINAL_GATES = (
    Gate(0.2, 1.5, looks=WHOLE),
    *(Gate(0.1, 1.0, looks=WHOLE),) * 2,
    *(Gate(0.05, 0.4, looks=WHOLE, refutes=True),) * 4,
)
"""Of the rounds after the flight. It begins from what was smoothed in flight: wider gates would
only bring together walls that are not one."""
FLYING_GATES = Gate(0.2, 1.5, looks=WHOLE), Gate(0.05, 0.4, looks=WHOLE, refutes=True)
"""While it flies the filters start from the last smoothing and are not far off.

Without the beams that go through them walls would grow beyond their ends, through rooms, and pull
at what is met beside them there."""
HITS_AT_ONCE = 3_000
"""Walls are looked for in so many hits at a time, which bounds memory and time."""
SQUARE_GATE_M = 0.2


class Smoother:
    """Gauss-Newton over one flight; the result does not depend on anything but the record."""

    def __init__(self, models: factors.Models, support: Support) -> None:
        self.models, self.support = models, support
        self._association = Association(models.ranges, models.odometry, support)

    def from_start(self, start: Array) -> MarginalPrior:
        """Before anything was seen: the first pose is `start` (3,), by definition of the frame.

        Odometry begins to wander when the drone lifts off.
        """
        gyro, odometry, ranges = self.models.gyro, self.models.odometry, self.models.ranges
        at = np.array([*start, self.models.rest_bias_rad_s, 0.0, 0.0, *np.zeros(factors.WALLS)])
        sigma = np.array(
            [
                *(factors.MIN_SIGMA,) * 3,
                gyro.bias_sigma_rad_s,
                *(factors.MIN_SIGMA,) * 2,
                gyro.scale_sigma,
                odometry.scale_sigma,
                *(ranges.gain_sigma + factors.MIN_SIGMA),
            ]
        )
        return MarginalPrior(0, at, Belief(np.diag(sigma**-2.0), np.zeros(len(sigma))))

    def smooth(
        self, x: Unknowns, m: Measured, past: MarginalPrior, gates: Sequence[Gate]
    ) -> Estimate:
        """The likeliest flight; `x` is where to begin from, and is set to it."""
        return at_once(self.smoothing(x, m, past, gates))

    def smoothing(
        self, x: Unknowns, m: Measured, past: MarginalPrior, gates: Sequence[Gate]
    ) -> Generator[None, None, Estimate]:
        """The same in pieces of some milliseconds: it yields after each.

        The first walls of `x` are those of the past, in their order.
        """
        known = past.walls
        for gate in gates:
            wall_of = self._association.associate(x, m, gate, known)
            yield
            if self.look_for_walls(x, m, wall_of, gate.looks):
                yield
                wall_of = self._association.associate(x, m, gate, known)
                yield
            before_rad = x.walls[:, 0].copy()
            solution = self.step(x, m, wall_of, past)
            yield
            square: tuple[tuple[int, int], ...] = ()
            if gate.across_m <= SQUARE_GATE_M:
                at = factors.WALLS + WALL_SIZE * np.arange(len(x.walls))
                covariance = solution.shared_covariance[np.ix_(at, at)]
                square = square_pairs((before_rad, x.walls[:, 0]), covariance)
            solution = self.step(x, m, wall_of, past, square)
            yield
        return Estimate(x, wall_of, solution)

    def look_for_walls(self, x: Unknowns, m: Measured, wall_of: Indices, keyframes: int) -> bool:
        """New walls in the hits of so many keyframes at a time that are on none; whether any."""
        known = len(x.walls)
        seen = project(x, m)
        sigma_m = self.models.ranges.sigma_m(m.beam, m.distance_m)
        loose: Indices = np.flatnonzero(wall_of == NO_WALL)
        chunk = m.frame[loose] // keyframes if keyframes else np.empty(0)
        for number in np.unique(chunk):
            some = loose[chunk == number]
            for low in range(0, len(some), HITS_AT_ONCE):
                part = some[low : low + HITS_AT_ONCE]
                cloud = Cloud(seen.points[part], sigma_m[part], seen.bearing_rad[part])
                x.add_walls(*detect_walls(cloud, self.support))
        return len(x.walls) > known

    def step(
        self,
        x: Unknowns,
        m: Measured,
        wall_of: Indices,
        past: MarginalPrior,
        square: Sequence[tuple[int, int]] = (),
    ) -> Solution:
        """One Gauss-Newton step of `x`, with the hits' walls as they are."""
        system = self.system(x, m, wall_of, past)
        for pair in square:
            factors.add_square(system, x, *pair)
        solution = system.solve()
        shared = solution.shared
        x.poses += solution.chained.reshape(-1, POSE_SIZE)
        x.gyro_scale += float(shared[factors.GYRO_SCALE])
        x.odometry_scale += float(shared[factors.ODOMETRY_SCALE])
        x.range_gain += shared[factors.GAINS : factors.WALLS]
        x.walls += shared[factors.WALLS :].reshape(-1, WALL_SIZE)
        return solution

    def past_before(
        self, frame: int, estimate: Estimate, m: Measured, past: MarginalPrior
    ) -> tuple[MarginalPrior, Estimate]:
        """What was measured before a later keyframe tells of it and of what is shared.

        And the estimate with the walls that were seen before it put first.
        """
        end, hits = frame + 1, m.first_hit(frame)
        seen = np.bincount(
            estimate.wall_of[:hits][estimate.wall_of[:hits] >= 0], minlength=len(estimate.x.walls)
        ).astype(bool)
        seen[: past.walls] = True
        order = np.argsort(~seen, kind="stable")
        x = estimate.x.since(0)
        wall_of = x.keep_walls(order, estimate.wall_of)
        solution = self.step(x, m, wall_of, past)
        before = x.since(0)
        before.poses = x.poses[:end]
        before.keep_walls(np.arange(int(seen.sum())), wall_of)
        part = m.between(0, end)
        wall_of_part = wall_of[: len(part.frame)].copy()
        wall_of_part[hits:] = NO_WALL
        belief = self.system(before, part, wall_of_part, past).belief_of_last(POSE_SIZE)
        now = MarginalPrior(past.frame + frame, values(before, frame), belief)
        return now, Estimate(x, wall_of, solution)

    def motion(self, x: Unknowns, m: Measured) -> BorderedSystem:
        """What odometry and the gyro say, without any wall."""
        system = factors.new_system(x)
        factors.add_odometry(system, x, m, self.models.odometry)
        factors.add_wander(system, x, m, self.models.odometry)
        factors.add_gyro(system, x, m, self.models)
        return system

    def system(
        self, x: Unknowns, m: Measured, wall_of: Indices, past: MarginalPrior
    ) -> BorderedSystem:
        """All equations, about `x` and with the hits' walls as they are."""
        system = self.motion(x, m)
        factors.add_hits(system, x, m, wall_of, self.models.ranges)
        self.believe(system, x, past)
        return system

    def believe(self, system: BorderedSystem, x: Unknowns, past: MarginalPrior) -> None:
        """What the past tells; of walls that it did not know next to nothing."""
        belief = past.belief.moved(past.beside(x))
        system.believe(belief.grown(POSE_SIZE + factors.WALLS + x.walls.size))
        walls = factors.WALLS + np.arange(x.walls.size)
        system.add(np.zeros(x.walls.size), UNKNOWN_SIGMA, [], [(walls, np.ones(x.walls.size))])


def at_once(work: Generator[None, None, Estimate]) -> Estimate:
    """What comes out of work that is otherwise done in pieces."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            estimate: Estimate = end.value
            return estimate

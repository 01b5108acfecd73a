"""Solves the whole flight at once: the most likely trajectory and walls by all measurements.

The filters decide at every moment; the smoother corrects early walls by later measurements. The
unknowns (`state.py`) are solved by Gauss-Newton (`factors.py`, `bordered_solver.py`):

    keyframes k: position p_k, heading ψ_k, gyro bias b_k, wander of the odometry w_k
    gyro scale g, odometry scale s, gain error γ of each range unit
    walls i: direction of the normal α_i, offset ρ_i           wall i: {p : p·n(α_i) = ρ_i}

Hits are associated with walls again in every round, with a narrower gate (`association.py`). A
Cauchy loss limits the influence of outliers. The last part of a long flight can be solved alone.
The measurements before are then a prior on its first pose and the shared unknowns.
"""

from collections.abc import Generator, Sequence

import numpy as np
from scipy.linalg import block_diag

from companion.core.arrays import Array, Indices
from companion.estimation.association.association import Association
from companion.estimation.association.gating import Gate
from companion.estimation.association.hough import Cloud, detect_walls
from companion.estimation.association.pruning import Support
from companion.estimation.association.right_angles import square_pairs
from companion.estimation.smoothing import factors
from companion.estimation.smoothing.bordered_solver import BorderedSystem, Gaussian, Solution
from companion.estimation.smoothing.estimate import (
    EarlierWalls,
    Estimate,
    MarginalPrior,
    StartPrior,
    values,
)
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.state import (
    CALIBRATION_SIZE,
    POSE_SIZE,
    WALL_SIZE,
    Measured,
    Unknowns,
    project,
)

UNKNOWN_SIGMA = 100.0
"""Sigma of a wall without information, m and rad. Chosen: it keeps the equations solvable."""
WHOLE = 1_000_000
"""Keyframes of a whole flight, for `Gate.detect_keyframes`."""
FINAL_GATES = (
    Gate(0.2, 1.5, detect_keyframes=WHOLE),
    *(Gate(0.1, 1.0, detect_keyframes=WHOLE),) * 2,
    *(Gate(0.05, 0.4, detect_keyframes=WHOLE, prunes_see_through=True),) * 4,
)
"""Gates of the rounds after the flight. Chosen: they start from the in-flight solution, and wider
gates would merge different walls."""
FLYING_GATES = (
    Gate(0.2, 1.5, detect_keyframes=WHOLE),
    Gate(0.05, 0.4, detect_keyframes=WHOLE, prunes_see_through=True),
)
"""Gates of the rounds in flight. Chosen: the filters start from the last solution and are accurate.

Without see-through pruning walls would extend through rooms and attract hits there."""
HITS_AT_ONCE = 3_000
"""Hits per call of the wall detection; bounds memory and time. Chosen."""
SQUARE_GATE_M = 0.2
"""Rounds with at most this gate constrain walls to right angles, m. Chosen."""


class Smoother:
    """Gauss-Newton over one flight or several. The result depends on the records alone."""

    def __init__(self, models: factors.Models, support: Support) -> None:
        self.models, self.support = models, support
        self._association = Association(models.ranges, models.odometry, support)

    def from_start(
        self,
        start: Array,
        later: tuple[StartPrior, ...] = (),
        earlier: EarlierWalls | None = None,
    ) -> MarginalPrior:
        """The prior without measurements, of one flight or of several.

        Without `earlier` flights, the first pose is `start` (3,) by definition of the frame.
        `later`: starts of the other flights.
        """
        gyro, odometry, ranges = self.models.gyro, self.models.odometry, self.models.ranges
        exact = np.full(3, factors.MIN_SIGMA)
        first = self.start_prior(0, start, exact if earlier is None else earlier.start_sigma)
        flights = 1 + len(later)
        gain_sigma = ranges.gain_sigma + factors.MIN_SIGMA
        calibration_sigma = np.array([gyro.scale_sigma, odometry.scale_sigma, *gain_sigma])
        at = np.concatenate([first.at, np.zeros(flights * CALIBRATION_SIZE)])
        sigma = np.concatenate([first.sigma, np.tile(calibration_sigma, flights)])
        information = np.diag(sigma**-2.0)
        if earlier is not None:
            at = np.concatenate([at, earlier.walls.ravel()])
            information = block_diag(information, np.linalg.inv(earlier.covariance))
        gaussian = Gaussian(information, np.zeros(len(at)))
        return MarginalPrior(0, at, gaussian, flights, later)

    def start_prior(
        self, frame: int, start: Array, sigma: Array, rest_bias_rad_s: float | None = None
    ) -> StartPrior:
        """Prior on a flight's first keyframe: north, east, yaw (3,) and their sigmas (3,).

        The odometry starts to wander at take-off. `rest_bias_rad_s`: by default that of the models.
        """
        bias = self.models.rest_bias_rad_s if rest_bias_rad_s is None else rest_bias_rad_s
        still = (factors.MIN_SIGMA,) * 2
        return StartPrior(
            frame,
            np.array([*start, bias, 0.0, 0.0]),
            np.array([*sigma, self.models.gyro.bias_sigma_rad_s, *still]),
        )

    def smooth(
        self, x: Unknowns, m: Measured, prior: MarginalPrior, gates: Sequence[Gate]
    ) -> Estimate:
        """The most likely solution. `x` is the initial value and is set to the result."""
        return run_to_end(self.smoothing(x, m, prior, gates))

    def smoothing(
        self, x: Unknowns, m: Measured, prior: MarginalPrior, gates: Sequence[Gate]
    ) -> Generator[None, None, Estimate]:
        """The same in pieces of some milliseconds: it yields after each.

        The first walls of `x` are those of the prior, in their order.
        """
        known = prior.walls
        for gate in gates:
            wall_of = yield from self.associated(x, m, gate, known)
            before_rad = x.walls[:, 0].copy()
            solution = self.step(x, m, wall_of, prior)
            yield
            square: tuple[tuple[int, int], ...] = ()
            if gate.across_m <= SQUARE_GATE_M:
                at = x.calibration.size + WALL_SIZE * np.arange(len(x.walls))
                covariance = solution.shared_covariance[np.ix_(at, at)]
                square = square_pairs((before_rad, x.walls[:, 0]), covariance)
            solution = self.step(x, m, wall_of, prior, square)
            yield
        return Estimate(x, wall_of, solution)

    def associated(
        self, x: Unknowns, m: Measured, gate: Gate, known: int
    ) -> Generator[None, None, Indices]:
        """(n,): each hit's wall or NO_WALL, after the detection of new walls.

        The first `known` walls stay, with hits or without. It yields after each piece.
        """
        wall_of = self._association.associate(x, m, gate, known)
        yield
        if self.detect_new_walls(x, m, wall_of, gate.detect_keyframes):
            yield
            wall_of = self._association.associate(x, m, gate, known)
            yield
        return wall_of

    def detect_new_walls(self, x: Unknowns, m: Measured, wall_of: Indices, keyframes: int) -> bool:
        """Detect walls in hits without a wall, `keyframes` at a time.

        True if there are new ones.
        """
        known = len(x.walls)
        rays = project(x, m)
        sigma_m = self.models.ranges.sigma_m(m.beam, m.distance_m)
        unassigned: Indices = np.flatnonzero(wall_of == NO_WALL)
        chunk = m.frame[unassigned] // keyframes if keyframes else np.empty(0)
        for number in np.unique(chunk):
            chunk_hits = unassigned[chunk == number]
            for low in range(0, len(chunk_hits), HITS_AT_ONCE):
                part = chunk_hits[low : low + HITS_AT_ONCE]
                cloud = Cloud(rays.points[part], sigma_m[part], rays.bearing_rad[part])
                x.add_walls(*detect_walls(cloud, self.support))
        return len(x.walls) > known

    def step(
        self,
        x: Unknowns,
        m: Measured,
        wall_of: Indices,
        prior: MarginalPrior,
        square: Sequence[tuple[int, int]] = (),
    ) -> Solution:
        """One Gauss-Newton step of `x` with the present associations."""
        system = self.system(x, m, wall_of, prior)
        for pair in square:
            factors.add_square(system, x, *pair)
        solution = system.solve()
        shared = solution.shared
        x.poses += solution.chained.reshape(-1, POSE_SIZE)
        x.calibration += shared[: x.calibration.size].reshape(x.calibration.shape)
        x.walls += shared[x.calibration.size :].reshape(-1, WALL_SIZE)
        return solution

    def marginalize_before(
        self, frame: int, estimate: Estimate, m: Measured, prior: MarginalPrior
    ) -> tuple[MarginalPrior, Estimate]:
        """Marginalize all measurements of one flight before a keyframe into a prior.

        Returns the prior and the estimate, whose walls with hits before the keyframe come first.
        """
        end, hits = frame + 1, m.first_hit(frame)
        rays = np.bincount(
            estimate.wall_of[:hits][estimate.wall_of[:hits] >= 0], minlength=len(estimate.x.walls)
        ).astype(bool)
        rays[: prior.walls] = True
        order = np.argsort(~rays, kind="stable")
        x = estimate.x.since(0)
        wall_of = x.keep_walls(order, estimate.wall_of)
        solution = self.step(x, m, wall_of, prior)
        before = x.since(0)
        before.poses = x.poses[:end]
        before.keep_walls(np.arange(int(rays.sum())), wall_of)
        part = m.between(0, end)
        wall_of_part = wall_of[: len(part.frame)].copy()
        wall_of_part[hits:] = NO_WALL
        gaussian = self.system(before, part, wall_of_part, prior).marginal_of_last(POSE_SIZE)
        now = MarginalPrior(prior.frame + frame, values(before, frame), gaussian)
        return now, Estimate(x, wall_of, solution)

    def motion(self, x: Unknowns, m: Measured) -> BorderedSystem:
        """Odometry and gyro factors alone."""
        system = factors.new_system(x, m)
        factors.add_odometry(system, x, m, self.models.odometry)
        factors.add_wander(system, x, m, self.models.odometry)
        factors.add_gyro(system, x, m, self.models)
        return system

    def system(
        self, x: Unknowns, m: Measured, wall_of: Indices, prior: MarginalPrior
    ) -> BorderedSystem:
        """All factors, linearized about `x` with the present associations."""
        system = self.motion(x, m)
        factors.add_hits(system, x, m, wall_of, self.models.ranges)
        self.add_prior(system, x, prior)
        return system

    def add_prior(self, system: BorderedSystem, x: Unknowns, prior: MarginalPrior) -> None:
        """Add the prior; walls that it does not contain get `UNKNOWN_SIGMA`."""
        gaussian = prior.gaussian.moved(prior.difference(x))
        system.add_prior(gaussian.grown(POSE_SIZE + x.calibration.size + x.walls.size))
        for start in prior.later:
            at = POSE_SIZE * start.frame + np.arange(POSE_SIZE)
            system.add(start.difference(x), start.sigma, [(at, np.ones(POSE_SIZE))])
        walls = x.calibration.size + np.arange(x.walls.size)
        system.add(np.zeros(x.walls.size), UNKNOWN_SIGMA, [], [(walls, np.ones(x.walls.size))])


def run_to_end(work: Generator[None, None, Estimate]) -> Estimate:
    """Run a generator to its end; returns its result."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            estimate: Estimate = end.value
            return estimate

"""Estimates trajectory and walls of a record from scratch, some keyframes at a time.

The smoother needs initial walls. Therefore the record is processed in stages. The next keyframes
are predicted by odometry and gyro with the present corrections. Their hits are associated with the
present walls, new walls are detected in the remaining hits, and all is solved: the whole flight, or
its last part (`WindowSchedule`).
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.estimation.association.gating import Gate
from companion.estimation.smoothing.estimate import Estimate
from companion.estimation.smoothing.factors import hit_residuals
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.smoother import WHOLE, Smoother
from companion.estimation.smoothing.state import (
    BIAS,
    POSE_SIZE,
    YAW,
    Measured,
    Unknowns,
    project,
    reach_m,
    to_ned,
)
from companion.estimation.smoothing.window_schedule import WindowSchedule, prior_frame

STAGE_M = 1.5
STAGE_RAD = math.radians(45)
STAGE_KEYFRAMES = 25
"""A stage ends after this path length, m, this turn, rad, or this number of keyframes. Chosen."""
SHORT_KEYFRAMES = 300
"""A shorter flight is solved as a whole at every stage, keyframes. Chosen: rows of a log may be a
metre apart, so a short part has too few hits."""
DETECTION_KEYFRAMES = 80
"""Walls are detected in hits of this many keyframes. Chosen: dead reckoning is accurate over
them."""
STAGE_GATES = (
    Gate(0.3, 2.0, detect_keyframes=DETECTION_KEYFRAMES),
    Gate(0.15, 1.5),
    Gate(0.08, 1.0),
)
"""Gates at each stage. Chosen."""
WHOLE_GATES = (
    *(Gate(0.3, 1.5, detect_keyframes=DETECTION_KEYFRAMES),) * 2,
    *(Gate(0.15, 1.0, detect_keyframes=DETECTION_KEYFRAMES),) * 2,
    *(Gate(0.05, 0.6, prunes_see_through=True),) * 4,
)
"""Gates of the final solution. Chosen."""
REDETECTION_GATES = Gate(0.05, 0.6, detect_keyframes=WHOLE), *WHOLE_GATES[3:]
"""Gates of the solution with newly detected walls. Chosen."""
STEPS_WITHOUT = 2
"""Gauss-Newton steps without some hits, from the solution with all. Chosen."""
NO_SCALE_SIGMA = 1e-3
"""Sigma of the odometry's scale when it is held. Chosen."""
STEPS_TO_SCALE = 6
"""Gauss-Newton steps to a map of another scale. Chosen."""
MIN_HITS_FOR_NOISE = 50
"""Least hits to estimate the range noise. Chosen."""
MAD_TO_SIGMA = 1.4826
"""Median absolute deviation to sigma of a Gaussian."""


class IncrementalMap:
    """Trajectory and walls of one record, built incrementally.

    `estimate` is the present solution.
    """

    def __init__(self, smoother: Smoother, m: Measured, start: Array) -> None:
        """`start` (3,): pose of the first keyframe, by definition of the frame."""
        self.smoother = smoother
        self._m = m
        self._start = smoother.from_start(start)
        self._prior = self._start
        self._schedule = WindowSchedule(SHORT_KEYFRAMES)
        self.x = Unknowns.at(start.reshape(1, 3).copy(), 0.0)
        self.wall_of: Indices = np.empty(0, dtype=np.int64)
        self.estimate: Estimate | None = None

    def grow(self, watch: Callable[[float], None]) -> None:
        """Process the record; `watch` is called with the share done."""
        frames = len(self._m.dt_s) + 1
        for end in stages(self._m):
            self.extend(end)
            self._solve(is_whole=self._schedule.is_whole(end))
            watch(end / frames)

    def extend(self, end: int) -> None:
        """Predict poses up to keyframe `end` by dead reckoning with the present scales and bias."""
        poses, x = self.x.poses, self.x
        yaw, bias = poses[-1, [YAW, BIAS]]
        k = np.arange(len(poses) - 1, end - 1)
        turns = (1 - x.gyro_scale) * self._m.turned_rad[k] - bias * self._m.dt_s[k]
        yaws = yaw + np.concatenate([[0.0], np.cumsum(turns)])
        steps = to_ned((1 + x.odometry_scale) * self._m.moved_frd_m[k], yaws[:-1])
        places = poses[-1, :2] + np.cumsum(steps, axis=0)
        predicted = np.tile(poses[-1], (len(k), 1))
        predicted[:, :YAW], predicted[:, YAW] = places, yaws[1:]
        x.poses = np.vstack([poses, predicted])

    def finish(self) -> None:
        """Solve the whole; then solve again with walls newly detected along the resulting path."""
        self._store(self.smoother.smooth(self.x, self._m, self._start, WHOLE_GATES))
        self.wall_of = self.x.keep_walls(np.empty(0, dtype=np.int64), self.wall_of)
        self._store(self.smoother.smooth(self.x, self._m, self._start, REDETECTION_GATES))

    def with_fixed_scale(self) -> "IncrementalMap":
        """The same record without a scale error of the odometry, with newly detected walls."""
        models = self.smoother.models
        odometry = replace(models.odometry, scale_sigma=NO_SCALE_SIGMA)
        smoother = Smoother(replace(models, odometry=odometry), self.smoother.support)
        held = IncrementalMap(smoother, self._m, self._start.at[: YAW + 1])
        held.x, held.wall_of = self.x.since(0), self.wall_of
        held.x.odometry_scale[:] = 0.0
        for _ in range(STEPS_TO_SCALE):
            smoother.step(held.x, self._m, held.wall_of, held._start)
        held.finish()
        return held

    def without(self, left_out: Mask) -> Unknowns:
        """The solution without the masked hits (n,); the associations of all others stay.

        Walls with too few remaining hits are dropped.
        """
        wall_of = np.where(left_out, NO_WALL, self.wall_of)
        x = self.x.since(0)
        hits = np.bincount(wall_of[wall_of != NO_WALL], minlength=len(x.walls))
        wall_of = x.keep_walls(np.flatnonzero(hits >= self.smoother.support.hits), wall_of)
        for _ in range(STEPS_WITHOUT):
            self.smoother.step(x, self._m, wall_of, self._start)
        x.reach_m = reach_m(x, project(x, self._m).points, wall_of)
        return x

    def sampled_paths(self, m: Measured, count: int) -> Iterator[Array]:
        """Samples of the path, (k, 2) each, from its covariance.

        `m`: the same measurements, maybe with other noise. The samples are always the same.
        """
        solution = self.smoother.system(self.x, m, self.wall_of, self._start).solve()
        unknowns = self.x.poses.size + len(solution.shared)
        unit = np.random.default_rng(0).normal(size=(unknowns, count))
        for sample in solution.samples_of_last(unit).T:
            yield (self.x.poses + sample.reshape(-1, POSE_SIZE))[:, :YAW]

    def noise_factor(self) -> float:
        """Ratio of the actual noise of ranges on walls to the assumed noise."""
        residual = hit_residuals(self.x, self._m, self.wall_of, self.smoother.models.ranges)
        if len(residual) < MIN_HITS_FOR_NOISE:
            return 1.0
        return MAD_TO_SIGMA * float(np.median(np.abs(residual)))

    def motion_misfit(self) -> float:
        """RMS residual of the odometry in sigmas.

        The equations of the wander are not counted: they determine only the wander itself.
        """
        no_walls = replace(self.x, walls=np.empty((0, 2)))
        motion = self.smoother.motion(no_walls, self._m)
        return math.sqrt(motion.squares / max(motion.rows - 2 * len(self._m.dt_s), 1))

    def _solve(self, *, is_whole: bool) -> None:
        """Solve the whole, or its last part. Move the prior if it is due."""
        prior = self._start if is_whole else self._prior
        m = self._m.between(prior.frame, len(self.x.poses))
        found = self.smoother.smooth(self.x.since(prior.frame), m, prior, STAGE_GATES)
        frame = prior_frame(len(found.x.poses), is_whole=is_whole)
        if frame is not None:
            self._prior, found = self.smoother.marginalize_before(frame, found, m, prior)
            if is_whole:
                self._schedule.solved_whole(len(self.x.poses))
        self._store(found, prior.frame)

    def _store(self, found: Estimate, since: int = 0) -> None:
        """Store an estimate that begins at a keyframe."""
        poses = self.x.poses.copy()
        poses[since:] = found.x.poses
        self.x = replace(found.x, poses=poses)
        self.estimate, self.wall_of = found, found.wall_of


def stages(m: Measured) -> list[int]:
    """Ends of the stages: after some path length, some turn, or some keyframes."""
    length = np.hypot(*m.moved_frd_m.T) / STAGE_M
    progress = length + np.abs(m.turned_rad) / STAGE_RAD + 1 / STAGE_KEYFRAMES
    ends = np.flatnonzero(np.diff(np.floor(np.cumsum(progress))) > 0) + 2
    return [*ends.tolist(), len(m.dt_s) + 1]

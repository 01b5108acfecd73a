"""Trajectory and walls from nothing but a record, a few steps at a time.

The smoother needs walls to begin with. Here the flight is gone through once more: the next key
frames follow from odometry and gyro as far as these are known by now, their hits are given to the
walls known so far, what is left over makes new walls, and all of it is solved. A long flight is
solved as a whole each time it has grown, and in between only its last part, with the rest as a
belief.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from companion.estimation.association.gating import Gate
from companion.estimation.smoothing.estimate import Estimate, MarginalPrior
from companion.estimation.smoothing.factors import hit_residuals
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.smoother import WHOLE, Smoother
from companion.estimation.smoothing.state import (
    BIAS,
    YAW,
    Array,
    Indices,
    Measured,
    Unknowns,
    project,
    reach_m,
    to_ned,
)

Mask = NDArray[np.bool_]

STAGE_M = 1.5
STAGE_RAD = math.radians(45)
STAGE_KEYFRAMES = 25
WHOLE_KEYFRAMES = 300
"""Up to this long the whole is solved at every stage."""
WINDOW_KEYFRAMES = 120
"""The last part begins this long before what was added."""
GROWN_BY = 1.2
"""Later it is solved each time it has become this much longer."""
DETECTION_KEYFRAMES = 80
"""Over which dead reckoning is straight enough for hits to show a wall."""
STAGE_GATES = (
    Gate(0.3, 2.0, detect_keyframes=DETECTION_KEYFRAMES),
    Gate(0.15, 1.5),
    Gate(0.08, 1.0),
)
WHOLE_GATES = (
    *(Gate(0.3, 1.5, detect_keyframes=DETECTION_KEYFRAMES),) * 2,
    *(Gate(0.15, 1.0, detect_keyframes=DETECTION_KEYFRAMES),) * 2,
    *(Gate(0.05, 0.6, prunes_see_through=True),) * 4,
)
ANEW_GATES = Gate(0.05, 0.6, detect_keyframes=WHOLE), *WHOLE_GATES[3:]
STEPS_WITHOUT = 2
"""Of Gauss-Newton, from what all hits made it; chosen."""
NO_SCALE_SIGMA = 1e-3
STEPS_TO_SCALE = 6
"""Of Gauss-Newton, from a map of another scale; chosen."""
MIN_HITS_FOR_NOISE = 50
MAD_TO_SIGMA = 1.4826


class Growth:
    """Trajectory and walls of one record; `estimate` is what is known of them so far."""

    def __init__(self, smoother: Smoother, m: Measured, start: Array) -> None:
        """`start` (3,) is the pose of the first key frame, by definition."""
        self.smoother = smoother
        self._m = m
        self._start = smoother.from_start(start)
        self._past = self._start
        self._whole_frames = 0
        self.x = Unknowns.at(start.reshape(1, 3).copy(), 0.0)
        self.wall_of: Indices = np.empty(0, dtype=np.int64)
        self.estimate: Estimate | None = None

    def grow(self, watch: Callable[[float], None]) -> None:
        """Go through the record; `watch` is told the share done."""
        frames = len(self._m.dt_s) + 1
        for end in stages(self._m):
            self.extend(end)
            if end <= WHOLE_KEYFRAMES or end >= GROWN_BY * self._whole_frames:
                self._solve_whole(STAGE_GATES)
            else:
                self._solve_part()
            watch(end / frames)

    def extend(self, end: int) -> None:
        """Dead reckoning on to key frame `end`, scales and bias as known by now."""
        poses, x = self.x.poses, self.x
        yaw, bias = poses[-1, [YAW, BIAS]]
        k = np.arange(len(poses) - 1, end - 1)
        turns = (1 - x.gyro_scale) * self._m.turned_rad[k] - bias * self._m.dt_s[k]
        yaws = yaw + np.concatenate([[0.0], np.cumsum(turns)])
        steps = to_ned((1 + x.odometry_scale) * self._m.moved_frd_m[k], yaws[:-1])
        places = poses[-1, :2] + np.cumsum(steps, axis=0)
        ahead = np.tile(poses[-1], (len(k), 1))
        ahead[:, :YAW], ahead[:, YAW] = places, yaws[1:]
        x.poses = np.vstack([poses, ahead])

    def finish(self) -> None:
        """All at once; then once more with walls looked for anew where the path now puts them."""
        self._keep(self.smoother.smooth(self.x, self._m, self._start, WHOLE_GATES))
        self.wall_of = self.x.keep_walls(np.empty(0, dtype=np.int64), self.wall_of)
        self._keep(self.smoother.smooth(self.x, self._m, self._start, ANEW_GATES))

    def held_to_scale(self) -> "Growth":
        """The same, had the odometry no scale error; with walls looked for anew."""
        models = self.smoother.models
        odometry = replace(models.odometry, scale_sigma=NO_SCALE_SIGMA)
        smoother = Smoother(replace(models, odometry=odometry), self.smoother.support)
        held = Growth(smoother, self._m, self._start.at[: YAW + 1])
        held.x, held.wall_of = self.x.since(0), self.wall_of
        held.x.odometry_scale = 0.0
        for _ in range(STEPS_TO_SCALE):
            smoother.step(held.x, self._m, held.wall_of, held._start)
        held.finish()
        return held

    def without(self, left_out: Mask) -> Unknowns:
        """What comes out if some hits (n,) are left out, and all others stay on their walls.

        Walls that are left with too few hits to be one are gone.
        """
        wall_of = np.where(left_out, NO_WALL, self.wall_of)
        x = self.x.since(0)
        hits = np.bincount(wall_of[wall_of != NO_WALL], minlength=len(x.walls))
        wall_of = x.keep_walls(np.flatnonzero(hits >= self.smoother.support.hits), wall_of)
        for _ in range(STEPS_WITHOUT):
            self.smoother.step(x, self._m, wall_of, self._start)
        x.reach_m = reach_m(x, project(x, self._m).points, wall_of)
        return x

    def noise_factor(self) -> float:
        """How much noisier the ranges on walls are than they are taken to be."""
        off = hit_residuals(self.x, self._m, self.wall_of, self.smoother.models.ranges)
        if len(off) < MIN_HITS_FOR_NOISE:
            return 1.0
        return MAD_TO_SIGMA * float(np.median(np.abs(off)))

    def motion_misfit(self) -> float:
        """How much the trajectory strains the odometry, in its sigmas.

        Of the equations of motion as many only tell of the wander, which nothing else asks for.
        """
        no_walls = replace(self.x, walls=np.empty((0, 2)))
        motion = self.smoother.motion(no_walls, self._m)
        return math.sqrt(motion.squares / max(motion.rows - 2 * len(self._m.dt_s), 1))

    def _solve_whole(self, gates: tuple[Gate, ...]) -> None:
        m = self._m.between(0, len(self.x.poses))
        self._take(self.smoother.smooth(self.x, m, self._start, gates), m, self._start)
        self._whole_frames = len(self.x.poses)

    def _solve_part(self) -> None:
        """What was added last, and some before it."""
        first = self._past.frame
        m = self._m.between(first, len(self.x.poses))
        part = self.smoother.smooth(self.x.since(first), m, self._past, STAGE_GATES)
        self._take(part, m, self._past)

    def _take(self, found: Estimate, m: Measured, past: MarginalPrior) -> None:
        """Go on from an estimate from the past's key frame on, and perhaps from a later past."""
        frame = len(found.x.poses) - WINDOW_KEYFRAMES
        if frame > 0:
            self._past, found = self.smoother.marginalize_before(frame, found, m, past)
        self._keep(found, past.frame)

    def _keep(self, found: Estimate, since: int = 0) -> None:
        """An estimate from a key frame on."""
        poses = self.x.poses.copy()
        poses[since:] = found.x.poses
        self.x = replace(found.x, poses=poses)
        self.estimate, self.wall_of = found, found.wall_of


def stages(m: Measured) -> list[int]:
    """Where each stage ends: after some way, some turn, or some key frames."""
    way = np.hypot(*m.moved_frd_m.T) / STAGE_M
    effort = way + np.abs(m.turned_rad) / STAGE_RAD + 1 / STAGE_KEYFRAMES
    ends = np.flatnonzero(np.diff(np.floor(np.cumsum(effort))) > 0) + 2
    return [*ends.tolist(), len(m.dt_s) + 1]

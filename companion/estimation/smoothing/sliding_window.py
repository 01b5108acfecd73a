"""Smoothing while it flies: a piece of some milliseconds a tick, again every few seconds.

The whole flight is solved each time it has become a quarter longer, its last part alone in
between, with the rest as a belief:

    |---------------- whole -----------------|
                                    |past ends here
                                    |-- part --|
                                    |----- part -----|
    |------------------------- whole ------------------------|

So what a second of flight costs does not grow with the flight.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np

from companion.core.frames import Vector2
from companion.estimation.association.pruning import Support
from companion.estimation.hypotheses.search import Doubt
from companion.estimation.smoothing import factors
from companion.estimation.smoothing.estimate import Estimate, MarginalPrior
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.flight_record import FlightRecord, FrameColumn
from companion.estimation.smoothing.smoother import FLYING_GATES, Smoother
from companion.estimation.smoothing.state import BIAS, POSE_SIZE, YAW, Array, Unknowns

PERIOD_S = 4.0
GROWN_BY = 1.25
SHORT_KEYFRAMES = 150
"""A flight this short is solved as a whole every time."""
FLYING_SUPPORT = Support(extent_m=0.6)
"""Of something short only one side may have been seen by now, and a line through it that is wrong
would pull at the pose."""
OVERLAP_KEYFRAMES = 100
"""The last part reaches so far back into what was solved as a whole."""
MAX_WHOLE_KEYFRAMES = 1800
"""Six minutes. Later the whole would take too long for one tick, and only parts are solved."""


@dataclass(frozen=True, slots=True)
class Walls:
    """Where the filters believe walls to be: lines and reaches (w, 2), as in `Unknowns`."""

    lines: Array
    reach_m: Array


@dataclass(frozen=True, slots=True)
class Improved:
    """What came out, and the moment of which it tells: that of its last keyframe."""

    estimate: Estimate
    first: int
    """Its first keyframe,"""
    first_hit: int
    time_s: float
    raw_ne_m: Vector2
    raw_yaw_rad: float


class InFlightSmoothing:
    """The one under way, if any."""

    def __init__(self, models: Models) -> None:
        self._smoother = Smoother(models, FLYING_SUPPORT)
        self._work: Generator[None, None, Improved] | None = None
        self._due_s = PERIOD_S
        self._past: MarginalPrior | None = None
        self._whole_keyframes = 0

    def step(
        self, now_s: float, record: FlightRecord, walls: Callable[[], Walls]
    ) -> Improved | None:
        """Do one piece; what came out, when it was the last one."""
        if self._work is None:
            if now_s >= self._due_s and len(record.frames) > 1:
                self._begin(record, walls())
                self._due_s = now_s + PERIOD_S
            return None
        try:
            next(self._work)
        except StopIteration as end:
            self._work = None
            improved: Improved = end.value
            return improved
        except np.linalg.LinAlgError:
            self._work = None  # the filters go on as they are, and the next one may do better
        return None

    def _begin(self, record: FlightRecord, walls: Walls) -> None:
        if not len(walls.lines):
            return
        record.thin()
        count = len(record.frames)
        is_whole = self._past is None or count < SHORT_KEYFRAMES
        is_whole |= GROWN_BY * self._whole_keyframes < count < MAX_WHOLE_KEYFRAMES
        self._work = self._smoothing(record, walls, is_whole)

    def _smoothing(
        self, record: FlightRecord, walls: Walls, is_whole: bool
    ) -> Generator[None, None, Improved]:
        smoother = self._smoother
        m = smoother.models.measured(record)
        poses = record.poses.copy()
        time_s = float(record.frames[-1, FrameColumn.TIME_S])
        raw_ne_m, raw_yaw_rad = record.raw
        past = smoother.from_start(np.zeros(3)) if is_whole else self._past
        assert past is not None
        first = past.frame
        part, first_hit = m.between(first, len(poses)), m.first_hit(first)
        x = Unknowns.at(poses[first:], smoother.models.rest_bias_rad_s)
        x.add_walls(walls.lines, walls.reach_m)
        begin_at(x, past)
        estimate = yield from smoother.smoothing(x, part, past, FLYING_GATES)
        estimate = yield from Doubt(smoother, part, past, FLYING_GATES).reconsidering(estimate)
        length = len(x.poses)
        if length > OVERLAP_KEYFRAMES and (is_whole or length > 3 * OVERLAP_KEYFRAMES):
            yield
            self._past, estimate = smoother.past_before(
                length - OVERLAP_KEYFRAMES, estimate, part, past
            )
            self._whole_keyframes = len(poses) if is_whole else self._whole_keyframes
        return Improved(estimate, first, first_hit, time_s, raw_ne_m, raw_yaw_rad)


def begin_at(x: Unknowns, past: MarginalPrior) -> None:
    """Scales, gains and bias as the past has them; headings without whole turns off."""
    pose, shared = past.at[:POSE_SIZE], past.at[POSE_SIZE:]
    turns = np.round((pose[YAW] - x.poses[0, YAW]) / (2 * np.pi))
    x.poses[:, YAW] += 2 * np.pi * turns
    x.poses[:, BIAS] = pose[BIAS]
    x.gyro_scale = float(shared[factors.GYRO_SCALE])
    x.odometry_scale = float(shared[factors.ODOMETRY_SCALE])
    x.range_gain = shared[factors.GAINS : factors.WALLS].copy()

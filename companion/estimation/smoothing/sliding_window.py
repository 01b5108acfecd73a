"""Smooths in flight, in pieces of some milliseconds a tick, repeated every few seconds."""

from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import Vector2
from companion.estimation.association.pruning import Support
from companion.estimation.hypotheses.search import HypothesisSearch
from companion.estimation.smoothing.estimate import EarlierWalls, Estimate, MarginalPrior
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.flight_record import FlightRecord, FrameColumn
from companion.estimation.smoothing.smoother import FLYING_GATES, Smoother
from companion.estimation.smoothing.state import BIAS, POSE_SIZE, YAW, Unknowns
from companion.estimation.smoothing.window_schedule import WindowSchedule, prior_frame

PERIOD_S = 4.0
"""Interval of the solutions, s. Chosen."""
SHORT_KEYFRAMES = 150
"""A shorter flight is always solved as a whole, keyframes. Chosen."""
FLYING_SUPPORT = Support(extent_m=0.6)
"""Minimum support of walls in flight. Chosen: of a short obstacle possibly only one side has been
measured, and a wrong line would bias the pose."""
MAX_WHOLE_KEYFRAMES = 1800
"""Longest flight solved as a whole, keyframes: six minutes. Chosen: later only parts are fast
enough."""


@dataclass(frozen=True, slots=True)
class Walls:
    """Walls of the filters: lines and reaches (w, 2), as in `Unknowns`."""

    lines: Array
    reach_m: Array


@dataclass(frozen=True, slots=True)
class WindowResult:
    """Result of one in-flight smoothing, valid at its last keyframe."""

    estimate: Estimate
    first: int
    """Index of its first keyframe in the flight."""
    first_hit: int
    time_s: float
    raw_ne_m: Vector2
    raw_yaw_rad: float


class InFlightSmoothing:
    """Runs one smoothing after the other, in pieces."""

    def __init__(self, models: Models, earlier: EarlierWalls | None = None) -> None:
        self._earlier = earlier
        self._smoother = Smoother(models, FLYING_SUPPORT)
        self._work: Generator[None, None, WindowResult] | None = None
        self._due_s = PERIOD_S
        self._prior: MarginalPrior | None = None
        self._schedule = WindowSchedule(SHORT_KEYFRAMES, MAX_WHOLE_KEYFRAMES)

    def step(
        self, now_s: float, record: FlightRecord, walls: Callable[[], Walls]
    ) -> WindowResult | None:
        """Do one piece; returns the result with the last piece."""
        if self._work is None:
            if now_s >= self._due_s and len(record.frames) > 1:
                self._begin(record, walls())
                self._due_s = now_s + PERIOD_S
            return None
        try:
            next(self._work)
        except StopIteration as end:
            self._work = None
            result: WindowResult = end.value
            return result
        except np.linalg.LinAlgError:
            self._work = None  # the filters continue; the next one may succeed
        return None

    def _begin(self, record: FlightRecord, walls: Walls) -> None:
        if not len(walls.lines):
            return
        record.thin()
        is_whole = self._schedule.is_whole(len(record.frames))
        self._work = self._smoothing(record, walls, is_whole)

    def _smoothing(
        self, record: FlightRecord, walls: Walls, is_whole: bool
    ) -> Generator[None, None, WindowResult]:
        smoother = self._smoother
        m = smoother.models.measured(record)
        poses = record.poses.copy()
        time_s = float(record.frames[-1, FrameColumn.TIME_S])
        raw_ne_m, raw_yaw_rad = record.raw
        prior = None if is_whole else self._prior
        if prior is None:
            prior = smoother.from_start(np.zeros(3), earlier=self._earlier)
        first = prior.frame
        part, first_hit = m.between(first, len(poses)), m.first_hit(first)
        x = Unknowns.at(poses[first:], smoother.models.rest_bias_rad_s)
        x.add_walls(walls.lines, walls.reach_m)
        initialize_from(x, prior)
        estimate = yield from smoother.smoothing(x, part, prior, FLYING_GATES)
        estimate = yield from HypothesisSearch(
            smoother, part, prior, FLYING_GATES
        ).in_flight_search(estimate)
        frame = prior_frame(len(x.poses), is_whole=is_whole)
        if frame is not None:
            yield
            self._prior, estimate = smoother.marginalize_before(frame, estimate, part, prior)
            if is_whole:
                self._schedule.solved_whole(len(poses))
        return WindowResult(estimate, first, first_hit, time_s, raw_ne_m, raw_yaw_rad)


def initialize_from(x: Unknowns, prior: MarginalPrior) -> None:
    """Take scales, gains and bias from the prior, and shift headings by whole turns to match it."""
    pose, shared = prior.at[:POSE_SIZE], prior.at[POSE_SIZE:]
    turns = np.round((pose[YAW] - x.poses[0, YAW]) / (2 * np.pi))
    x.poses[:, YAW] += 2 * np.pi * turns
    x.poses[:, BIAS] = pose[BIAS]
    x.calibration = shared[: x.calibration.size].reshape(x.calibration.shape).copy()

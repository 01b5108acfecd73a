"""Smoothing while it flies: a piece of some milliseconds a tick, again every few seconds."""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

from companion.estimation.keyframes import Keyframes
from companion.estimation.smoother import FLYING_GATES_M, Smoothed, Smoother
from companion.frames import Vector2
from companion.messages import WallLine

PERIOD_S = 4.0
MOST_KEYFRAMES = 1000
"""Later, a piece of smoothing would take longer than a tick may."""


@dataclass(frozen=True, slots=True)
class Begun:
    """Of a smoothing its last keyframe, and how many hits it was given."""

    time_s: float
    raw_ne_m: Vector2
    raw_yaw_rad: float
    hits: int


class InFlightSmoothing:
    """The one under way, if any."""

    def __init__(self, smoother: Smoother) -> None:
        self._smoother = smoother
        self._work: Generator[None, None, Smoothed] | None = None
        self._begun = Begun(0.0, (0.0, 0.0), 0.0, 0)
        self._due_s = PERIOD_S

    def step(
        self, now_s: float, keyframes: Keyframes, walls: Callable[[], Sequence[WallLine]]
    ) -> tuple[Smoothed, Begun] | None:
        """Do one piece; what came out, when it was the last one."""
        if self._work is None:
            if now_s >= self._due_s and 1 < len(keyframes.frames) <= MOST_KEYFRAMES:
                self._begin(keyframes, walls())
                self._due_s = now_s + PERIOD_S
            return None
        try:
            next(self._work)
        except StopIteration as end:
            self._work = None
            return end.value, self._begun
        return None

    def _begin(self, keyframes: Keyframes, walls: Sequence[WallLine]) -> None:
        if not walls:
            return
        frames, hits = keyframes.frames.copy(), keyframes.hits.copy()
        self._begun = Begun(frames[-1].time_s, *keyframes.raw, len(hits))
        self._work = self._smoother.smoothing(frames, hits, walls, FLYING_GATES_M)

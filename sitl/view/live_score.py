"""Scores the map during the flight, in a background thread."""

import threading
import time
from collections.abc import Callable

from companion.core.messages import FloorPlan, WallSegment
from sitl.core.truth import TrueState
from sitl.scoring.score import MapScore, score_map
from sitl.world.format import World
from sitl.world.plan import observable_points, wall_surfaces

REST_SHARE = 4.0
"""Pause after each score, as a multiple of its computing time, so that the page has priority."""
MIN_REST_S = 0.5
"""Shortest pause, s. Chosen."""


class LiveScore:
    """Scores one flight's map. `on_score` gets the scores in a separate thread."""

    def __init__(
        self,
        world: World,
        height_m: float,
        take_off: TrueState,
        on_score: Callable[[MapScore], None],
    ) -> None:
        self._world = world
        self._height_m = height_m
        self._take_off = take_off
        self._on_score = on_score
        self._latest: tuple[tuple[WallSegment, ...], TrueState] | None = None
        self._is_over = False
        self._change = threading.Condition()
        threading.Thread(target=self._work, daemon=True).start()

    def update(self, walls: tuple[WallSegment, ...], take_off: TrueState) -> None:
        """Score these walls; their frame is that of `take_off`."""
        if not walls:
            return
        with self._change:
            self._latest = walls, take_off
            self._change.notify()

    def end(self) -> None:
        with self._change:
            self._is_over = True
            self._change.notify()

    def _work(self) -> None:
        surfaces = wall_surfaces(self._world, self._height_m)
        north, east, _ = self._take_off.position_ned_m
        observable = observable_points(self._world, self._height_m, (north, east))
        closed = self._world.closed_border
        while (latest := self._next()) is not None:
            began_s = time.monotonic()
            walls, take_off = latest
            score = score_map(FloorPlan(walls), surfaces, observable, take_off, closed)
            if not self._is_over:
                self._on_score(score)
            self._rest(max(MIN_REST_S, REST_SHARE * (time.monotonic() - began_s)))

    def _next(self) -> tuple[tuple[WallSegment, ...], TrueState] | None:
        with self._change:
            self._change.wait_for(lambda: self._is_over or self._latest)
            latest, self._latest = self._latest, None
            return None if self._is_over else latest

    def _rest(self, rest_s: float) -> None:
        with self._change:
            self._change.wait_for(lambda: self._is_over, rest_s)

"""The flight that the page shows: what was seen of it, its scores, and its speed."""

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.config.settings import Config
from companion.core.messages import FloorPlan
from sitl.core.truth import TrueState
from sitl.scoring.score import MapScore
from sitl.view.controls import FAST
from sitl.view.flight.messages import Seen, SeenDrone
from sitl.view.live_score import LiveScore

REMEMBERED = 1500
"""Moments kept: more than a minute at 20 Hz."""
SPEED_OVER_S = 2.0
"""Time over which the speed is measured, s."""
KEPT = 0.9
"""Share of the speed asked for below which the page says why. Chosen. The flight waits for nothing
but the processor."""


@dataclass
class Shown:
    """The flight on the page."""

    config: Config
    take_offs: Sequence[TrueState]
    """Of each drone."""
    scoring: LiveScore
    seen: deque[tuple[float, Seen]] = field(default_factory=lambda: deque(maxlen=REMEMBERED))
    """Moments with their wall time, s."""
    score: MapScore | None = None
    plan: FloorPlan | None = None
    asked: float = 0.0
    """Factor of real time that is asked for; 0 is a pause."""
    asked_wall_s: float = 0.0
    """Since when, wall time, s."""

    def ask(self, speed: float) -> None:
        self.asked, self.asked_wall_s = speed, time.monotonic()

    def speed(self) -> str:
        """Speed over the last seconds, in times real time, and why it is not the one asked for."""
        if not self.asked:
            return "paused"
        last_wall_s, last = self.seen[-1]
        since_s = max(self.asked_wall_s, last_wall_s - SPEED_OVER_S)
        moments = (moment for moment in self.seen if moment[0] >= since_s)
        first_wall_s, first = next(moments, self.seen[-1])
        if last_wall_s - first_wall_s < SPEED_OVER_S / 4:
            return "–"
        flown = (last.time_s - first.time_s) / (last_wall_s - first_wall_s)
        if self.asked == FAST or flown > KEPT * self.asked or self.plan is not None:
            return f"{flown:.1f} × real time"
        return f"{flown:.1f} of {self.asked:g} × real time: the processor is busy"

    def truth_rows(self, drone: SeenDrone) -> dict[str, str]:
        """What only the simulator knows, as rows for the table of numbers."""
        rows = {
            "least clearance": f"{drone.clearance_m:.2f} m",
            "collisions": str(drone.collisions),
        }
        if (score := self.score) is not None:
            rows |= {
                "coverage": f"{score.coverage:.0%}",
                "wall error, aligned": f"{score.wall_error_aligned_cm:.1f} cm",
                "in take-off frame": f"{score.wall_error_cm:.1f} cm",
            }
        return rows

"""The nose swings to and fro about the way, so that a beam passes over all of its width.

    the way's side   ─ ─ ─ ─ ─ ─ ─ ─ ─ ╱╲─ ─ ─
    the nose             ╱╲      ╱╲  ╱    ╲       off the way, over time: at an even rate,
    the way        ─────╱──╲────╱──╲╱──────╲──    to where nothing is left to be gone through
    its other side ─ ─ ╱─ ─ ╲─ ╱─ ─ ─ ─ ─ ─ ─ ╲

At an even rate two readings are nowhere farther apart than they must be: a sine, quickest in the
middle of the way, leaves gaps there. It turns back where no beam is left to go (`seen_free.py`):
wide where a leg begins, for the way is wide to look at near the drone; and little later, when it
was looked at from afar.
"""

import math
from dataclasses import dataclass

from companion.safety.seen_free import Lane

RATE_RAD_S = math.radians(45)
"""Two readings of a sensor that measures twenty times a second are 4 cm apart a metre away. Chosen
by `benchmarks/legs.py`: at 0.6 m/s among legs 0.1 % of those in the way are met too late, 0.2 % at
30 deg/s, for the nose comes back too late, and at 60, for the readings are too far apart."""
MIN_RAD, MAX_RAD = math.radians(3), math.radians(75)
"""Bounds of the swing to either side. Chosen: a beam's own jitter; what the body touches first
after a corner lies up to 60° off the way, seen from the sensor."""


@dataclass(frozen=True, slots=True)
class Swing:
    """To which side the nose turns now, 1 is right."""

    side: int = 1

    @property
    def rate_rad_s(self) -> float:
        return self.side * RATE_RAD_S

    def onward(self, off_rad: float, lane: Lane) -> "Swing":
        """With the nose so far to the right of the way."""
        to_rad = lane.right_rad if self.side > 0 else lane.left_rad
        wide_rad = min(max(to_rad, MIN_RAD), MAX_RAD)
        return Swing(-self.side) if off_rad * self.side > wide_rad else self


TO_THE_RIGHT = Swing()

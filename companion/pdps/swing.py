"""The nose swings to and fro about the way, so that a beam passes over all of its width.

    the way's side   ─ ─ ─ ─ ─ ─ ─ ─ ─ ╱╲─ ─ ─
    the nose             ╱╲      ╱╲  ╱    ╲       off the way, over time: at an even rate,
    the way        ─────╱──╲────╱──╲╱──────╲──    as far as what is to be looked at
    its other side ─ ─ ╱─ ─ ╲─ ╱─ ─ ─ ─ ─ ─ ─ ╲

At an even rate two readings are nowhere farther apart than they must be: a sine, quickest in the
middle of the way, leaves gaps there. Near the drone the way is wide to look at; it is looked at
where a leg begins, and later from afar.
"""

import math
from dataclasses import dataclass

RATE_RAD_S = math.radians(36)
"""Two readings of a sensor that measures twenty times a second are 3 cm apart a metre away."""
LEAST_RAD, MOST_RAD = math.radians(8), math.radians(40)
HALF_WAY_M = 0.2
"""From the middle of the way to its side."""
FROM_M = 0.2
"""From the drone's centre to the front of its body."""


@dataclass(frozen=True, slots=True)
class Swing:
    """To which side the nose turns now, 1 is right."""

    side: int = 1

    @property
    def rate_rad_s(self) -> float:
        return self.side * RATE_RAD_S

    def onward(self, off_rad: float, ahead_m: float) -> "Swing":
        """With the nose so far to the right of the way, of which so much ahead was looked at."""
        wide_rad = min(max(math.atan2(HALF_WAY_M, FROM_M + ahead_m), LEAST_RAD), MOST_RAD)
        return Swing(-self.side) if off_rad * self.side > wide_rad else self


TO_THE_RIGHT = Swing()

"""Swings the nose to both sides of the path, so that a beam sweeps the path's full width.

    path's right edge ─ ─ ─ ─ ─ ─ ─ ─ ─ ╱╲─ ─ ─
    nose                  ╱╲      ╱╲  ╱    ╲       angle off the path, over time: at a constant
    path            ─────╱──╲────╱──╲╱──────╲──    rate, to the edge of what is not swept yet
    path's left edge─ ─ ╱─ ─ ╲─ ╱─ ─ ─ ─ ─ ─ ─ ╲

The constant rate keeps the spacing of the readings even. A sine is fastest in the middle of the
path and leaves gaps there. The nose turns back where everything is swept (`swept_space.py`). At the
beginning of a leg the swing is wide, because the path covers a wide angle near the drone. Later it
is small, because the path ahead was already swept from a distance.
"""

import math
from dataclasses import dataclass

from companion.safety.swept_space import Lane

RATE_RAD_S = math.radians(45)
"""Yaw rate of the swing, rad/s. Readings of a 20 Hz sensor are then 4 cm apart at 1 m.

Chosen by `benchmarks/flight/legs.py`: at 0.6 m/s among legs, 0.1 % of the legs on the path are
detected too late. At 30 deg/s it is 0.2 %, because the nose returns too late; at 60 deg/s as well,
because the readings are too far apart.
"""
MIN_RAD, MAX_RAD = math.radians(3), math.radians(75)
"""Bounds of the swing to either side, rad. Chosen: the minimum is a beam's jitter. After a corner,
the first obstacle that the hull can touch lies up to 60° off the path, from the sensor."""


@dataclass(frozen=True, slots=True)
class Swing:
    """Direction in which the nose turns."""

    side: int = 1
    """1 is right, -1 is left."""

    @property
    def rate_rad_s(self) -> float:
        return self.side * RATE_RAD_S

    def onward(self, off_rad: float, lane: Lane) -> "Swing":
        """The next swing, with the nose `off_rad` to the right of the path."""
        to_rad = lane.right_rad if self.side > 0 else lane.left_rad
        wide_rad = min(max(to_rad, MIN_RAD), MAX_RAD)
        return Swing(-self.side) if off_rad * self.side > wide_rad else self


TO_THE_RIGHT = Swing()
"""The first swing of a course."""

"""Whether the level beams look where they should.

While the drone turns once on the spot, each beam sees the same all around, one after the other. A
beam that agrees with the front one only if it looks elsewhere is wired or mounted wrongly.
"""

import math
from collections.abc import Mapping
from statistics import median

from companion.messages import BEARING_FRD_RAD, Beam, RangeScan

BINS = 36
ENOUGH_TURN_RAD = math.radians(330)
ON_THE_SPOT_M = 0.4
LEAST_COMMON = 12
LEAST_OFF_M = 0.4
CLEARLY = 0.5
"""The other direction explains what was seen with so much less error, or better."""
QUARTER = BINS // 4
Seen = dict[int, float]
"""Distance by heading of the drone, in bins."""


class MountingWatch:
    """Looks at every full turn."""

    def __init__(self) -> None:
        self.misplaced: tuple[Beam, ...] = ()
        self._began_rad = 0.0
        self._began_at_ne_m = (math.nan, math.nan)
        self._seen: dict[Beam, Seen] = {}

    def take(self, scan: RangeScan, place_ne_m: tuple[float, float], turned_rad: float) -> None:
        """Take in one sweep; `turned_rad` is how far the drone has turned in all."""
        if not math.dist(place_ne_m, self._began_at_ne_m) < ON_THE_SPOT_M:  # true for NaN too
            self._begin(place_ne_m, turned_rad)
        heading = round(turned_rad * BINS / math.tau) % BINS
        for beam in BEARING_FRD_RAD:
            reading = scan.readings.get(beam)
            if reading is not None and reading.is_distance:
                self._seen.setdefault(beam, {})[heading] = reading.distance_m
        if abs(turned_rad - self._began_rad) > ENOUGH_TURN_RAD:
            self.misplaced = misplaced(self._seen)
            self._begin(place_ne_m, turned_rad)

    def _begin(self, place_ne_m: tuple[float, float], turned_rad: float) -> None:
        self._began_at_ne_m, self._began_rad = place_ne_m, turned_rad
        self._seen.clear()


def misplaced(seen: Mapping[Beam, Seen]) -> tuple[Beam, ...]:
    """The beams that do not fit the front one as they are, but would looking elsewhere."""
    front = seen.get(Beam.FRONT, {})
    return tuple(
        beam for beam in seen if beam is not Beam.FRONT and _is_misplaced(beam, front, seen[beam])
    )


def _is_misplaced(beam: Beam, front: Seen, other: Seen) -> bool:
    own = round(BEARING_FRD_RAD[beam] / (math.pi / 2)) % 4
    off_m = [_off_m(front, other, quarters) for quarters in range(4)]
    return off_m[own] > LEAST_OFF_M and min(off_m) < CLEARLY * off_m[own]


def _off_m(front: Seen, other: Seen, quarters: int) -> float:
    """How far apart the two are if the other looks so many quarters clockwise of the front."""
    pairs = [
        abs(front[there] - distance_m)
        for heading, distance_m in other.items()
        if (there := (heading + quarters * QUARTER) % BINS) in front
    ]
    return median(pairs) if len(pairs) >= LEAST_COMMON else math.inf

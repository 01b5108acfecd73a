"""Whether the level beams look where they should.

While the drone turns once on the spot, each beam sees the same all around, one after the other. A
beam that agrees with the front one only if it looks elsewhere is wired or mounted wrongly; one that
has agreed, and would not have elsewhere, is right for the rest of the flight, whatever a maze looks
like later on. Where that says nothing, as in the middle of a square, moving does (`beam_line.py`).
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from statistics import median

from companion.core.frames import frd_to_ned
from companion.core.messages import BEARING_FRD_RAD, Beam, RangeScan
from companion.safety.health.beam_line import BeamLine, Stand
from companion.safety.health.ranges import Travel

BINS = 36
ENOUGH_TURN_RAD = math.radians(330)
ON_THE_SPOT_M = 0.4
MAX_STEP_RAD = math.radians(15)
"""From one sweep to the next; else part of the turn was missed: what is alike may be by chance."""
MIN_COMMON = 12
MIN_OFF_M = 0.4
CLEARLY = 0.5
"""The other direction explains what was seen with so much less error, or better."""
QUARTER = BINS // 4
Seen = dict[int, float]
"""Distance by heading of the drone, in bins."""


class MountingWatch:
    """Looks at every full turn."""

    def __init__(self) -> None:
        self.misplaced: tuple[Beam, ...] = ()
        self._began_rad = self._turned_rad = 0.0
        self._began_at_ne_m = (math.nan, math.nan)
        self._seen: dict[Beam, Seen] = {}
        self._right: set[Beam] = set()
        self._lines = {beam: BeamLine(beam) for beam in BEARING_FRD_RAD}
        self._stand, self._travel = Stand(), (0.0, 0.0, 0.0, 0.0)

    def take(self, scan: RangeScan, place_ne_m: tuple[float, float], travel: Travel) -> None:
        """Take in one sweep; `travel` is how far the drone has gone and turned in all."""
        turned_rad = travel[3]
        self._move(travel)
        is_on_the_spot = math.dist(place_ne_m, self._began_at_ne_m) < ON_THE_SPOT_M
        missed = abs(turned_rad - self._turned_rad) > MAX_STEP_RAD
        self._turned_rad = turned_rad
        if missed or not is_on_the_spot:  # false for NaN
            self._begin(place_ne_m, turned_rad)
        heading = round(turned_rad * BINS / math.tau) % BINS
        for beam in BEARING_FRD_RAD:
            reading = scan.readings.get(beam)
            if reading is None:
                continue
            if reading.is_distance:
                self._seen.setdefault(beam, {})[heading] = reading.distance_m
            self._lines[beam].take(scan.time_s, reading, self._stand)
        self._note(beam for beam, line in self._lines.items() if line.is_off(scan.time_s))
        if abs(turned_rad - self._began_rad) > ENOUGH_TURN_RAD:
            told = self._right.union(self.misplaced)
            self._note(beam for beam in misplaced(self._seen) if beam not in told)
            self._right.update(placed(self._seen))
            self._begin(place_ne_m, turned_rad)

    def _move(self, travel: Travel) -> None:
        """By what odometry says, turned by the gyro."""
        forward_m, right_m, _, _ = (a - b for a, b in zip(travel, self._travel, strict=True))
        ahead_m, aside_m = frd_to_ned(forward_m, right_m, travel[3])
        last, self._travel = self._stand, travel
        self._stand = Stand(last.ahead_m + ahead_m, last.right_m + aside_m, travel[3])

    def _note(self, wrong: Iterable[Beam]) -> None:
        for beam in wrong:
            if beam not in self.misplaced:
                self.misplaced += (beam,)

    def _begin(self, place_ne_m: tuple[float, float], turned_rad: float) -> None:
        self._began_at_ne_m, self._began_rad = place_ne_m, turned_rad
        self._seen.clear()


def misplaced(seen: Mapping[Beam, Seen]) -> tuple[Beam, ...]:
    """The beams that do not fit the front one as they are, but would looking elsewhere."""
    return tuple(
        beam
        for beam, (own_m, elsewhere_m) in _fits(seen)
        if own_m > MIN_OFF_M and elsewhere_m < CLEARLY * own_m
    )


def placed(seen: Mapping[Beam, Seen]) -> tuple[Beam, ...]:
    """The beams that fit the front one as they are, and would not looking elsewhere."""
    return tuple(
        beam
        for beam, (own_m, elsewhere_m) in _fits(seen)
        if elsewhere_m > MIN_OFF_M and own_m < CLEARLY * elsewhere_m
    )


def _fits(seen: Mapping[Beam, Seen]) -> Iterator[tuple[Beam, tuple[float, float]]]:
    """How far each beam is off the front one: as it is, and at best looking elsewhere."""
    front = seen.get(Beam.FRONT, {})
    for beam in seen:
        if beam is Beam.FRONT:
            continue
        own = round(BEARING_FRD_RAD[beam] / (math.pi / 2)) % 4
        off_m = [_off_m(front, seen[beam], quarters) for quarters in range(4)]
        yield beam, (off_m.pop(own), min(off_m))


def _off_m(front: Seen, other: Seen, quarters: int) -> float:
    """How far apart the two are if the other looks so many quarters clockwise of the front."""
    pairs = [
        abs(front[there] - distance_m)
        for heading, distance_m in other.items()
        if (there := (heading + quarters * QUARTER) % BINS) in front
    ]
    return median(pairs) if len(pairs) >= MIN_COMMON else math.inf

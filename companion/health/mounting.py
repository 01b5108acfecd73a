"""Whether the level beams look where they should.

While the drone turns once on the spot, each beam sees the same all around, one after the other. A
beam that agrees with the front one only if it looks elsewhere is wired or mounted wrongly; one that
has agreed, and would not have elsewhere, is right for the rest of the flight, whatever a maze looks
like later on. Where that says nothing, as in the middle of a square, moving does: what a beam looks
at comes nearer by as much as the drone goes there.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import combinations
from statistics import median

from companion.health.ranges import Travel
from companion.messages import BEARING_FRD_RAD, Beam, RangeReading, RangeScan

BINS = 36
ENOUGH_TURN_RAD = math.radians(330)
ON_THE_SPOT_M = 0.4
MOST_STEP_RAD = math.radians(15)
"""From one sweep to the next; else part of the turn was missed: what is alike may be by chance."""
LEAST_COMMON = 12
LEAST_OFF_M = 0.4
CLEARLY = 0.5
"""The other direction explains what was seen with so much less error, or better."""
QUARTER = BINS // 4
WAY_M, MOST_ASIDE_M, MOST_TURN_RAD = 0.4, 0.2, math.radians(5)
"""Along a beam, and so far, before what it reads is compared, when the nose, which may swing
meanwhile, points there again by so much."""
LEAST_OBLIQUE, GRAZING = math.tan(math.radians(20)), math.tan(math.radians(75))
"""Bounds of the tangent of the incidence; chosen. Noise hides less, and no reading is exact beyond.
The reading of a wall that is met obliquely changes also as the drone moves aside and turns."""
SWUNG_RAD = math.radians(1.5)
"""The least swing that shows the incidence: noise of 5 cm changes the tangent by 0.6 at 3 m."""
EXACT_M, EDGE_M = 0.06, 0.25
"""Sigma of a reading that tells something; a change between two readings that is an edge."""
LEAST_SHARE, AGAINST = 0.5, 3
"""Nearer by less than this share of the way, so many times on end; or of two beams together. One
that reads more by as much, as the beam on the other side should, counts twice."""
TOGETHER_S = 1.0
"""Two beams that speak against their places within so long tell of one motion: they are swapped."""
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
        self._ways = {beam: _Way(beam) for beam in BEARING_FRD_RAD}

    def take(self, scan: RangeScan, place_ne_m: tuple[float, float], travel: Travel) -> None:
        """Take in one sweep; `travel` is how far the drone has gone and turned in all."""
        turned_rad = travel[3]
        is_on_the_spot = math.dist(place_ne_m, self._began_at_ne_m) < ON_THE_SPOT_M
        missed = abs(turned_rad - self._turned_rad) > MOST_STEP_RAD
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
            self._ways[beam].take(scan.time_s, reading, travel)
        self._note(self._wrong_way())
        if abs(turned_rad - self._began_rad) > ENOUGH_TURN_RAD:
            told = self._right.union(self.misplaced)
            self._note(beam for beam in misplaced(self._seen) if beam not in told)
            self._right.update(placed(self._seen))
            self._begin(place_ne_m, turned_rad)

    def _wrong_way(self) -> list[Beam]:
        """Beams that read more where the drone comes nearer."""
        wrong = [beam for beam, way in self._ways.items() if way.against >= AGAINST]
        for one, other in combinations(self._ways, 2):
            ways = self._ways[one], self._ways[other]
            is_one_motion = abs(ways[0].against_s - ways[1].against_s) <= TOGETHER_S
            if is_one_motion and sum(way.against for way in ways) >= AGAINST:
                wrong += [one, other]
        return wrong

    def _note(self, wrong: Iterable[Beam]) -> None:
        for beam in wrong:
            if beam not in self.misplaced:
                self.misplaced += (beam,)

    def _begin(self, place_ne_m: tuple[float, float], turned_rad: float) -> None:
        self._began_at_ne_m, self._began_rad = place_ne_m, turned_rad
        self._seen.clear()


class _Way:
    """Along one beam: does it read less by as much as the drone comes nearer?"""

    def __init__(self, beam: Beam) -> None:
        bearing_rad = BEARING_FRD_RAD[beam]
        self._axis_frd = math.cos(bearing_rad), math.sin(bearing_rad)
        self._readings: list[tuple[float, Travel]] = []
        """The one that the next is compared with, the two between of the nose farthest left and
        right, and the last."""
        self._last_m = math.nan
        self.against = 0
        """So often on end, or twice as often, the reading went the wrong way,"""
        self.against_s = -math.inf
        """the last time then."""

    def take(self, now_s: float, reading: RangeReading, travel: Travel) -> None:
        """Take in one reading."""
        is_exact = reading.is_distance and reading.variance_m2 < EXACT_M**2
        is_edge = abs(reading.distance_m - self._last_m) > EDGE_M
        self._last_m = reading.distance_m
        if not is_exact or is_edge:
            self._readings.clear()
        else:
            between = self._readings[1:]
            if len(between) > 2:
                between = [min(between, key=_turned_rad), max(between, key=_turned_rad)]
            self._readings[1:] = [*between, (reading.distance_m, travel)]
            self._compare(now_s)

    def _since(self, travel: Travel) -> tuple[float, float, float]:
        """How far the drone has moved along the beam and aside, and turned, since the first one."""
        (_, then), (x, y) = self._readings[0], self._axis_frd
        forward_m, right_m, _, turn_rad = (a - b for a, b in zip(travel, then, strict=True))
        return forward_m * x + right_m * y, right_m * x - forward_m * y, turn_rad

    def _compare(self, now_s: float) -> None:
        (then_m, _), (now_m, travel) = self._readings[0], self._readings[-1]
        along_m, aside_m, turn_rad = self._since(travel)
        if abs(aside_m) > MOST_ASIDE_M:
            self._readings = [(now_m, travel)]
        elif abs(along_m) > WAY_M and abs(turn_rad) < MOST_TURN_RAD:
            nearer_m = (then_m - now_m) * math.copysign(1.0, along_m)
            missing_m = LEAST_SHARE * abs(along_m) - nearer_m
            obliquely_m = self._oblique() * (abs(aside_m) + now_m * abs(turn_rad))
            if 0 < missing_m <= obliquely_m:
                return  # farther on it will show
            if missing_m <= 0:
                self.against = 0
            else:
                is_opposite = nearer_m < -LEAST_SHARE * abs(along_m)
                self.against += 2 if is_opposite else 1
                self.against_s = now_s
            self._readings = [(now_m, travel)]

    def _oblique(self) -> float:
        """Tangent of the incidence, by how the reading changed when the nose swung the farthest.

        `GRAZING` if it did not swing: then nothing is known of it.
        """
        (then_m, _), (now_m, now) = self._readings[0], self._readings[-1]
        all_along_m, _, all_turned_rad = self._since(now)
        most_rad, oblique = SWUNG_RAD, GRAZING
        for reading_m, travel in self._readings[1:-1]:
            along_m, _, turn_rad = self._since(travel)
            share = along_m / all_along_m
            swung_rad = abs(turn_rad - share * all_turned_rad)
            if swung_rad > most_rad:
                off_m = abs(reading_m - then_m - share * (now_m - then_m))
                most_rad, oblique = swung_rad, off_m / (reading_m * swung_rad)
        return max(LEAST_OBLIQUE, min(oblique, GRAZING))


def _turned_rad(reading: tuple[float, Travel]) -> float:
    return reading[1][3]


def misplaced(seen: Mapping[Beam, Seen]) -> tuple[Beam, ...]:
    """The beams that do not fit the front one as they are, but would looking elsewhere."""
    return tuple(
        beam
        for beam, (own_m, elsewhere_m) in _fits(seen)
        if own_m > LEAST_OFF_M and elsewhere_m < CLEARLY * own_m
    )


def placed(seen: Mapping[Beam, Seen]) -> tuple[Beam, ...]:
    """The beams that fit the front one as they are, and would not looking elsewhere."""
    return tuple(
        beam
        for beam, (own_m, elsewhere_m) in _fits(seen)
        if elsewhere_m > LEAST_OFF_M and own_m < CLEARLY * elsewhere_m
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
    return median(pairs) if len(pairs) >= LEAST_COMMON else math.inf

"""Detects level range sensors that are mounted or wired in a wrong direction.

While the drone turns once on the spot, each beam measures the same surroundings in turn. A beam may
agree with the front beam only in another direction. It is then wired or mounted wrongly. A beam
that agrees in its own direction alone is accepted for the rest of the flight, because a maze may
look different later. The comparison is ambiguous in symmetric rooms, such as in the middle of a
square. There, motion decides (`beam_line.py`).
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from statistics import median

from companion.core.frames import frd_to_ned
from companion.core.messages import BEARING_FRD_RAD, Beam, RangeScan
from companion.safety.health.beam_line import BeamLine, Stand
from companion.safety.health.ranges import Travel

BINS = 36
"""Number of heading bins in a turn. Chosen."""
ENOUGH_TURN_RAD = math.radians(330)
"""Turn after which the beams are compared, rad. Chosen."""
ON_THE_SPOT_M = 0.4
"""Maximum distance from the start of a turn, m. Chosen."""
MAX_STEP_RAD = math.radians(15)
"""Maximum turn between two sweeps, rad. Chosen: with a larger one, part of the turn is missing, and
agreement may be coincidence."""
MIN_COMMON = 12
"""Minimum number of bins that two beams have in common. Chosen."""
MIN_OFF_M = 0.4
"""Minimum median error of a direction that does not fit, m. Chosen."""
CLEARLY = 0.5
"""Maximum ratio of the error of the fitting direction to that of the other. Chosen."""
QUARTER = BINS // 4
"""Number of bins in a quarter turn."""
Seen = dict[int, float]
"""Distance, m, by the bin of the drone's heading."""


class MountingWatch:
    """Compares the level beams after every full turn."""

    def __init__(self) -> None:
        self.misplaced: tuple[Beam, ...] = ()
        self._began_rad = self._turned_rad = 0.0
        self._began_at_ne_m = (math.nan, math.nan)
        self._seen: dict[Beam, Seen] = {}
        self._right: set[Beam] = set()
        self._lines = {beam: BeamLine(beam) for beam in BEARING_FRD_RAD}
        self._stand, self._travel = Stand(), (0.0, 0.0, 0.0, 0.0)

    def take(self, scan: RangeScan, place_ne_m: tuple[float, float], travel: Travel) -> None:
        """Add one sweep; `travel` is the drone's total motion and turn since the start."""
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
            decided = self._right.union(self.misplaced)
            self._note(beam for beam in misplaced(self._seen) if beam not in decided)
            self._right.update(placed(self._seen))
            self._begin(place_ne_m, turned_rad)

    def _move(self, travel: Travel) -> None:
        """Advance the position by odometry, rotated by the gyro's heading."""
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
    """Beams that fit the front beam only in another direction."""
    return tuple(
        beam
        for beam, (own_m, elsewhere_m) in _fits(seen)
        if own_m > MIN_OFF_M and elsewhere_m < CLEARLY * own_m
    )


def placed(seen: Mapping[Beam, Seen]) -> tuple[Beam, ...]:
    """Beams that fit the front beam in their own direction only."""
    return tuple(
        beam
        for beam, (own_m, elsewhere_m) in _fits(seen)
        if elsewhere_m > MIN_OFF_M and own_m < CLEARLY * elsewhere_m
    )


def _fits(seen: Mapping[Beam, Seen]) -> Iterator[tuple[Beam, tuple[float, float]]]:
    """Median error of each beam against the front one, m: its own and the best other direction."""
    front = seen.get(Beam.FRONT, {})
    for beam in seen:
        if beam is Beam.FRONT:
            continue
        own = round(BEARING_FRD_RAD[beam] / (math.pi / 2)) % 4
        off_m = [_off_m(front, seen[beam], quarters) for quarters in range(4)]
        yield beam, (off_m.pop(own), min(off_m))


def _off_m(front: Seen, other: Seen, quarters: int) -> float:
    """Median error, m, if `other` points `quarters` quarter turns clockwise of the front."""
    pairs = [
        abs(front[there] - distance_m)
        for heading, distance_m in other.items()
        if (there := (heading + quarters * QUARTER) % BINS) in front
    ]
    return median(pairs) if len(pairs) >= MIN_COMMON else math.inf

"""Finds what has changed between the flights of a survey: a door shut, furniture moved.

Walls are cut into short pieces. For each flight a piece is there if most beams that met it ended on
it, and not there if most passed through. The last flight that met it decides what is in the map.
Longer changes are listed:

    flight 1   flight 2   flight 3
    there      -          passed     the piece is gone: not in the map
    passed     there      -          the piece is new
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2
from companion.estimation.association.pruning import Support
from companion.estimation.association.see_through import Crossings
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import Measured, Unknowns, place_on, project

PIECE_M = 0.25
"""Greatest length of a piece of wall, m. Chosen: a flight along a wall has a dozen hits on it."""
MIN_BEAMS = 4
"""Least beams of a flight that show a piece, or its absence. Chosen: one or two may be outliers."""
MIN_CHANGED_M = 0.4
"""Least length of a change, m. Chosen: the least opening in a wall; shorter ones may be errors of a
pose at the end of a wall."""
APART_M, ASIDE_M = 0.15, 0.1
"""Two changes are one if their ends are closer than the first, m, and the longer line through both
passes their inner ends closer than the second, m. Chosen: half a piece, and the offset of a door
from the wall in which it stands."""
THERE, PASSED, UNKNOWN = 1, -1, 0
"""What a flight shows of a piece."""


@dataclass(frozen=True, slots=True)
class Change:
    """A straight piece of wall that is gone or new since a flight."""

    is_new: bool
    flight: int
    """Number of the first flight that found the change, from 0."""
    start_ne_m: Vector2
    end_ne_m: Vector2

    @property
    def length_m(self) -> float:
        return math.dist(self.start_ne_m, self.end_ne_m)

    def off_m(self, place_ne_m: Vector2) -> float:
        """Distance of a place from its line, m."""
        (north_m, east_m), (to_north_m, to_east_m) = self.start_ne_m, self.end_ne_m
        ahead = to_north_m - north_m, to_east_m - east_m
        off = place_ne_m[0] - north_m, place_ne_m[1] - east_m
        return abs(off[0] * ahead[1] - off[1] * ahead[0]) / max(self.length_m, 1e-9)

    def in_words(self, flight: str) -> str:
        """One line for the user; `flight`: name of the flight that found the change."""
        (north_m, east_m), (to_north_m, to_east_m) = self.start_ne_m, self.end_ne_m
        return (
            f"{'new' if self.is_new else 'gone'} since {flight}: wall from {north_m:+.1f} m north, "
            f"{east_m:+.1f} m east to {to_north_m:+.1f} m north, {to_east_m:+.1f} m east"
        )


@dataclass(frozen=True, slots=True)
class Changes:
    """All changes between the flights, and the walls as the last flights saw them."""

    listed: tuple[Change, ...]
    wall_of: Indices
    """(n,): wall of each hit, or NO_WALL for hits on what is gone."""


def changes(x: Unknowns, m: Measured, wall_of: Indices, units: RangeUnits) -> Changes:
    """Compare the flights of a joint solution with its walls of hits (n,)."""
    seen = _crossings(x, m, wall_of, units)
    shown = _shown(seen)
    last, since = _last(shown)
    is_gone = (last == PASSED) & (shown == THERE).any(axis=1)
    is_new = (last == THERE) & _was_passed_before(shown, since)
    found: list[Change] = []
    for changed, new in ((is_gone, False), (is_new, True)):
        for run in _runs(seen, changed, since):
            pieces = seen.pieces
            wall, low_m, high_m = pieces.wall[run[0]], pieces.low_m[run[0]], pieces.high_m[run[-1]]
            start, end = (place_on(x.walls[wall], along_m) for along_m in (low_m, high_m))
            found.append(Change(new, int(since[run[0]]), start, end))
    listed = [each for each in joined(found) if each.length_m >= MIN_CHANGED_M]
    kept = _without(x, m, wall_of, seen.hit[(last == PASSED)[seen.stopped]])
    return Changes(tuple(sorted(listed, key=lambda each: each.flight)), kept)


def joined(found: Sequence[Change]) -> list[Change]:
    """The changes, with those that continue each other in a line as one."""
    left = list(found)
    for one, other in combinations(found, 2):
        whole = _both(one, other)
        if whole is not None:
            return joined([each for each in left if each not in (one, other)] + [whole])
    return left


def _both(one: Change, other: Change) -> Change | None:
    """Two changes as one, or None if they do not continue each other."""
    if (one.is_new, one.flight) != (other.is_new, other.flight):
        return None
    ends = ((one.start_ne_m, one.end_ne_m), (other.start_ne_m, other.end_ne_m))
    outer = max(product(*ends), key=lambda pair: math.dist(*pair))
    inner = [end if far == start else start for (start, end), far in zip(ends, outer, strict=True)]
    whole = Change(one.is_new, one.flight, *outer)
    lengths_m = one.length_m + other.length_m
    is_straight = all(whole.off_m(each) <= ASIDE_M for each in inner)
    continues = math.dist(*inner) <= APART_M and whole.length_m >= max(lengths_m - APART_M, 1e-9)
    return whole if is_straight and continues else None


def _without(x: Unknowns, m: Measured, wall_of: Indices, gone: Indices) -> Indices:
    """(n,): walls of the hits without those on what is gone, and without the weak rest of a wall.

    The rest is weak if it alone would not have become a wall.
    """
    kept, support, points = wall_of.copy(), Support(), project(x, m).points
    kept[gone] = NO_WALL
    for wall in np.unique(wall_of[gone]):
        rest = np.flatnonzero(kept == wall)
        along_m = points[rest] @ x.tangents[wall]
        if len(rest) < support.hits or np.ptp(along_m) < support.extent_m:
            kept[rest] = NO_WALL
    return kept


def contradicted_shares(x: Unknowns, m: Measured, wall_of: Indices, units: RangeUnits) -> Array:
    """(f,): how far each flight and another contradict each other, the mean over all others.

    Two flights contradict each other by the share of one's hits on pieces of wall that the other
    passed through; the greater of both shares counts.
    """
    flights = len(m.begins)
    seen = _crossings(x, m, wall_of, units)
    flight = m.hit_flight[seen.hit]
    was_passed = _shown(seen)[seen.stopped] == PASSED
    share = np.zeros((flights, flights))
    for one in range(flights):
        share[one] = was_passed[flight == one].mean(axis=0) if (flight == one).any() else 0.0
    between = np.maximum(share, share.T)
    mean: Array = between.sum(axis=1) / max(flights - 1, 1)
    return mean


def _crossings(x: Unknowns, m: Measured, wall_of: Indices, units: RangeUnits) -> Crossings:
    """The beams of all flights that met the walls of all flights."""
    sigma_m, opening_m = units.sigma_m(m.beam, m.distance_m), Support().opening_m
    return Crossings.of(x, project(x, m), sigma_m, wall_of, opening_m, piece_m=PIECE_M)


def _shown(seen: Crossings) -> Indices:
    """(p, f): what each flight shows of each piece."""
    stopped, passed = seen.by_flight()
    there = (stopped >= MIN_BEAMS) & (stopped > passed)
    through = (passed >= MIN_BEAMS) & (passed > stopped)
    return np.where(there, THERE, np.where(through, PASSED, UNKNOWN))


def _last(shown: Indices) -> tuple[Indices, Indices]:
    """(p,) each: the last that is known of each piece, and the first flight since it is so."""
    last, since = np.zeros(len(shown), dtype=np.int64), np.zeros(len(shown), dtype=np.int64)
    for flight, state in enumerate(shown.T):
        differs = (state != UNKNOWN) & (state != last)
        last, since = np.where(differs, state, last), np.where(differs, flight, since)
    return last, since


def _was_passed_before(shown: Indices, since: Indices) -> Mask:
    """(p,): True for pieces that an earlier flight passed through."""
    earlier = np.arange(shown.shape[1]) < since[:, None]
    was_passed: Mask = ((shown == PASSED) & earlier).any(axis=1)
    return was_passed


def _runs(seen: Crossings, changed: Mask, since: Indices) -> Iterator[Indices]:
    """Changed pieces that continue each other along a wall, changed since one flight."""
    pieces: Indices = np.flatnonzero(changed)
    follows = np.diff(pieces) == 1
    follows &= np.diff(seen.pieces.wall[pieces]) == 0
    follows &= np.diff(since[pieces]) == 0
    follows &= seen.pieces.low_m[pieces[1:]] - seen.pieces.high_m[pieces[:-1]] <= APART_M
    yield from (run for run in np.split(pieces, np.flatnonzero(~follows) + 1) if len(run))

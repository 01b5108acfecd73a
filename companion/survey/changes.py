"""Finds what has changed between the flights of a survey: a door shut, furniture moved.

Walls are cut into short pieces. For each flight a piece is there if most beams that met it ended on
it, and not there if most passed through. The last flight that met it decides what is in the map.
Longer changes are listed:

    flight 1   flight 2   flight 3
    there      -          passed     the piece is gone: not in the map
    passed     there      -          the piece is new
"""

from collections.abc import Iterator
from dataclasses import dataclass

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
    listed: list[Change] = []
    for changed, new in ((is_gone, False), (is_new, True)):
        for run in _runs(seen, changed, since):
            pieces = seen.pieces
            wall, low_m, high_m = pieces.wall[run[0]], pieces.low_m[run[0]], pieces.high_m[run[-1]]
            if high_m - low_m < MIN_CHANGED_M:
                continue
            start, end = (place_on(x.walls[wall], along_m) for along_m in (low_m, high_m))
            listed.append(Change(new, int(since[run[0]]), start, end))
    kept = _without(x, m, wall_of, seen.hit[(last == PASSED)[seen.stopped]])
    return Changes(tuple(sorted(listed, key=lambda each: each.flight)), kept)


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
    """Changed pieces that follow each other along a wall, changed since one flight."""
    pieces: Indices = np.flatnonzero(changed)
    follows = np.diff(pieces) == 1
    follows &= np.diff(seen.pieces.wall[pieces]) == 0
    follows &= np.diff(since[pieces]) == 0
    yield from (run for run in np.split(pieces, np.flatnonzero(~follows) + 1) if len(run))

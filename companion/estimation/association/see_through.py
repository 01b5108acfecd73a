"""Finds hits on pieces of wall that beams passed through, and hits behind firm pieces of wall."""

from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.state import Rays, Unknowns, in_rows

THROUGH_M = 0.08
"""A beam passed through a wall if its hit is this far behind it, plus the sigmas below, m.
Chosen."""
THROUGH_SIGMAS = 2.0
"""Sigmas of the range added to `THROUGH_M`. Chosen."""
MAX_PASSED_SHARE = 0.5
MIN_PASSED = 3
"""A piece of wall is refuted if at least this many beams passed through it, and more than this
share of the number that it stopped. Chosen."""
FIRM_PASSED_SHARE, FIRM_STOPPED = 0.1, 6
"""A piece is firm if it stopped this many beams and passed at most this share of their number. Hits
behind a firm piece are wrong. Chosen."""
STRETCH_M = 0.5
"""Largest length of a piece, m. Chosen: a wall may end where beams begin to pass."""
CELLS_AT_ONCE = 1_000_000
"""Beams times walls processed together; bounds the memory. Chosen."""
FAR_M = 1e6
"""Longer than any wall, m."""


def passed_through(
    x: Unknowns, rays: Rays, sigma_m: Array, wall_of: Indices, opening_m: float
) -> Mask:
    """(n,): True for hits on pieces of wall that beams passed through.

    Also True for hits whose beam would have passed through a firm piece. A piece is a short row of
    hits on one wall with no gap above `opening_m`.
    """
    seen = Crossings.of(x, rays, sigma_m, wall_of, opening_m)
    stopped, passed = seen.by_flight()
    is_refuted = (passed > MAX_PASSED_SHARE * stopped) & (passed >= MIN_PASSED)
    wrong = np.zeros(len(wall_of), dtype=bool)
    wrong[seen.hit] = is_refuted[seen.stopped, rays.flight[seen.hit]]
    is_firm = (passed <= FIRM_PASSED_SHARE * stopped) & (stopped >= FIRM_STOPPED)
    wrong[seen.beam[is_firm[seen.passed, rays.flight[seen.beam]]]] = True
    return wrong


def passages(
    x: Unknowns, rays: Rays, sigma_m: Array, wall_of: Indices, opening_m: float
) -> Indices:
    """(w,): number of beams that passed through each wall, between its hits and not in an opening.

    Lines through legs and the edges of furniture have hits enough to exist, but beams pass between.
    Beams count where their own flight detected the wall, too.
    """
    seen = Crossings.of(x, rays, sigma_m, wall_of, opening_m)
    stopped, _ = seen.by_flight()
    counts = stopped[seen.passed, rays.flight[seen.beam]] > 0
    return np.bincount(seen.pieces.wall[seen.passed[counts]], minlength=len(x.walls))


@dataclass(frozen=True, slots=True)
class Pieces:
    """Straight pieces of wall, ordered by level, wall and position, (p,)."""

    level: Indices
    """Level of flight at which it was detected."""
    wall: Indices
    low_m: Array
    """Position along the wall, m."""
    high_m: Array

    def at(self, level: Indices, wall: Indices, along_m: Array) -> tuple[Indices, Mask]:
        """The pieces at positions on walls (n,), and a mask of the positions with one."""
        walls = int(max(self.wall.max(), wall.max(initial=0))) + 1
        own, number = walls * self.level + self.wall, walls * level + wall
        before = np.searchsorted(FAR_M * own + self.low_m, FAR_M * number + along_m) - 1
        piece = np.maximum(before, 0)
        inside = (before >= 0) & (own[piece] == number) & (along_m < self.high_m[piece])
        return piece, inside


@dataclass(frozen=True, slots=True)
class Crossings:
    """Which beams ended on pieces of wall, and which passed through.

    A piece belongs to one level, because a higher level sees over a low wall. The flights are
    counted one by one: between two flights a door may be shut, and furniture may move.
    """

    pieces: Pieces
    hit: Indices
    """(h,): hits on walls."""
    stopped: Indices
    """(h,): piece of each."""
    beam: Indices
    """(b,): beams that passed through a piece."""
    passed: Indices
    """(b,): piece that each passed through."""
    flight: Indices
    """(n,): flight of each beam and hit."""

    def by_flight(self) -> tuple[Indices, Indices]:
        """Number of beams of each flight that ended on each piece, and that passed: (p, f) each."""
        flights, pieces = int(self.flight.max(initial=0)) + 1, len(self.pieces.wall)
        stopped, passed = (
            np.bincount(piece * flights + self.flight[beam], minlength=pieces * flights)
            for piece, beam in ((self.stopped, self.hit), (self.passed, self.beam))
        )
        return stopped.reshape(-1, flights), passed.reshape(-1, flights)

    @classmethod
    def of(
        cls,
        x: Unknowns,
        rays: Rays,
        sigma_m: Array,
        wall_of: Indices,
        opening_m: float,
        *,
        piece_m: float = STRETCH_M,
    ) -> "Crossings":
        """Cut the walls into pieces of at most `piece_m`, and find the beams that cross them."""
        hit = np.flatnonzero(wall_of != NO_WALL)
        order, along, is_first = in_rows(
            x, rays.points[hit], wall_of[hit], opening_m, rays.level[hit]
        )
        hit = hit[order]
        is_first |= np.diff(np.floor(along / piece_m), prepend=0) != 0
        first = np.flatnonzero(is_first)
        last = np.append(first[1:], len(hit)) - 1 if len(first) else first
        one = hit[first]
        pieces = Pieces(rays.level[one], wall_of[one], along[first], along[last])
        passages = _passages(x, rays, sigma_m, pieces)
        return cls(pieces, hit, np.cumsum(is_first) - 1, *passages, rays.flight)


def _passages(x: Unknowns, rays: Rays, sigma_m: Array, pieces: Pieces) -> tuple[Indices, Indices]:
    """Pairs of a beam and a piece of wall that it passed through: beams and pieces."""
    if not len(pieces.wall):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    margin_m = THROUGH_M + THROUGH_SIGMAS * sigma_m
    step = max(1, CELLS_AT_ONCE // len(x.walls))
    beams, passed = [], []
    for low in range(0, len(rays.points), step):
        origins, points = rays.origins[low : low + step], rays.points[low : low + step]
        from_m, to_m = (ends @ x.normals.T - x.walls[:, 1] for ends in (origins, points))
        crosses = (from_m < 0) != (to_m < 0)
        crosses &= np.abs(to_m) > margin_m[low : low + step, None]
        beam, wall = np.nonzero(crosses)
        share = from_m[beam, wall] / (from_m[beam, wall] - to_m[beam, wall])
        met = origins[beam] + share[:, None] * (points[beam] - origins[beam])
        along_m = (met * x.tangents[wall]).sum(axis=1)
        piece, inside = pieces.at(rays.level[low + beam], wall, along_m)
        beams.append(low + beam[inside])
        passed.append(piece[inside])
    return np.concatenate(beams), np.concatenate(passed)

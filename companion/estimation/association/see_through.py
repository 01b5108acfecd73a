"""Against a wall: beams that went through it, and walls that stand before it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.state import Array, Indices, Sightings, Unknowns, in_rows

Mask = NDArray[np.bool_]

THROUGH_M = 0.08
"""A beam went through a wall if its hit lies this far behind it, besides two sigmas."""
THROUGH_SIGMAS = 2.0
MAX_PASSED_SHARE = 0.5
MIN_PASSED = 3
"""A piece of wall through which so many beams went, and more than that share of those that it
stopped, is none."""
FIRM_PASSED_SHARE, FIRM_STOPPED = 0.1, 6
"""One that stopped so many and let hardly any through is there; what was met behind it was not."""
STRETCH_M = 0.5
"""Pieces are no longer than this: a wall may end where beams begin to go through."""
CELLS_AT_ONCE = 1_000_000
"""Beams times walls looked at together, which bounds the memory."""
FAR_M = 1e6
"""Longer than any wall."""


def refuted(
    x: Unknowns, seen: Sightings, sigma_m: Array, wall_of: Indices, opening_m: float
) -> Mask:
    """(n,): whether each hit is on a piece of wall that beams went through.

    Or its own beam would have had to go through one that is there for sure. A piece
    is a short row of hits on one wall with no more than `opening_m` between them.
    """
    hit, piece, pieces = _pieces(x, seen.points, wall_of, opening_m)
    beam, gone_through = _went_through(x, seen, sigma_m, pieces)
    passed = np.bincount(gone_through, minlength=len(pieces.wall))
    stopped = np.bincount(piece, minlength=len(pieces.wall))
    against = (passed > MAX_PASSED_SHARE * stopped) & (passed >= MIN_PASSED)
    wrong = np.zeros(len(wall_of), dtype=bool)
    wrong[hit] = against[piece]
    firm = (passed <= FIRM_PASSED_SHARE * stopped) & (stopped >= FIRM_STOPPED)
    wrong[beam[firm[gone_through]]] = True
    return wrong


@dataclass(frozen=True, slots=True)
class _Pieces:
    """Straight pieces of wall in order of wall and place, (p,)."""

    wall: Indices
    low_m: Array
    """Along the wall."""
    high_m: Array

    def at(self, wall: Indices, along_m: Array) -> tuple[Indices, Mask]:
        """The pieces at places on walls (n,), and whether there is one."""
        before = np.searchsorted(FAR_M * self.wall + self.low_m, FAR_M * wall + along_m) - 1
        piece = np.maximum(before, 0)
        inside = (before >= 0) & (self.wall[piece] == wall) & (along_m < self.high_m[piece])
        return piece, inside


def _pieces(
    x: Unknowns, points: Array, wall_of: Indices, opening_m: float
) -> tuple[Indices, Indices, _Pieces]:
    """Hits that have a wall (h,), the piece of each (h,), and the pieces."""
    hit = np.flatnonzero(wall_of != NO_WALL)
    order, along, is_first = in_rows(x, points[hit], wall_of[hit], opening_m)
    hit = hit[order]
    is_first |= np.diff(np.floor(along / STRETCH_M), prepend=0) != 0
    first = np.flatnonzero(is_first)
    last = np.append(first[1:], len(hit)) - 1 if len(first) else first
    pieces = _Pieces(wall_of[hit][first], along[first], along[last])
    return hit, np.cumsum(is_first) - 1, pieces


def _went_through(
    x: Unknowns, seen: Sightings, sigma_m: Array, pieces: _Pieces
) -> tuple[Indices, Indices]:
    """Beams that went through pieces of wall: of each such pair the beam and the piece."""
    if not len(pieces.wall):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    margin_m = THROUGH_M + THROUGH_SIGMAS * sigma_m
    step = max(1, CELLS_AT_ONCE // len(x.walls))
    beams, passed = [], []
    for low in range(0, len(seen.points), step):
        eyes, points = seen.eyes[low : low + step], seen.points[low : low + step]
        from_m, to_m = (ends @ x.normals.T - x.walls[:, 1] for ends in (eyes, points))
        crosses = (from_m < 0) != (to_m < 0)
        crosses &= np.abs(to_m) > margin_m[low : low + step, None]
        beam, wall = np.nonzero(crosses)
        share = from_m[beam, wall] / (from_m[beam, wall] - to_m[beam, wall])
        met = eyes[beam] + share[:, None] * (points[beam] - eyes[beam])
        piece, inside = pieces.at(wall, (met * x.tangents[wall]).sum(axis=1))
        beams.append(low + beam[inside])
        passed.append(piece[inside])
    return np.concatenate(beams), np.concatenate(passed)

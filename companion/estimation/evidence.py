"""Against a wall: beams that went through it, and walls that stand before it."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from companion.estimation.flight_record import NO_WALL
from companion.estimation.unknowns import Array, Indices, Sightings, Unknowns, in_rows

Mask = NDArray[np.bool_]

THROUGH_M = 0.08
"""A beam went through a wall if its hit lies this far behind it, besides two sigmas."""
THROUGH_SIGMAS = 2.0
MOST_PASSED_SHARE = 0.5
LEAST_PASSED = 3
"""A piece of wall through which so many beams went, and more than that share of those that it
stopped, is none."""
FIRM_PASSED_SHARE, FIRM_STOPPED = 0.1, 6
"""One that stopped so many and let hardly any through is there; what was met behind it was not."""
STRETCH_M = 0.5
"""Pieces are no longer than this: a wall may end where beams begin to go through."""
CELLS_AT_ONCE = 1_000_000
"""Beams times pieces looked at together, which bounds the memory."""


def refuted(
    x: Unknowns, seen: Sightings, sigma_m: Array, wall_of: Indices, opening_m: float
) -> Mask:
    """(n,): whether each hit is on a piece of wall that beams went through.

    Or its own beam would have had to go through one that is there for sure. A piece
    is a short row of hits on one wall with no more than `opening_m` between them.
    """
    hit, piece, ends = _pieces(x, seen.points, wall_of, opening_m)
    passed = np.zeros(len(ends), dtype=np.int64)
    for _, through in _went_through(seen, sigma_m, ends):
        passed += through.sum(axis=0)
    stopped = np.bincount(piece, minlength=len(ends))
    against = (passed > MOST_PASSED_SHARE * stopped) & (passed >= LEAST_PASSED)
    wrong = np.zeros(len(wall_of), dtype=bool)
    wrong[hit] = against[piece]
    firm = (passed <= FIRM_PASSED_SHARE * stopped) & (stopped >= FIRM_STOPPED)
    for part, through in _went_through(seen, sigma_m, ends[firm]):
        wrong[part] |= through.any(axis=1)
    return wrong


def _went_through(seen: Sightings, sigma_m: Array, pieces: Array) -> Iterator[tuple[slice, Mask]]:
    """Which beams (n,) went through which straight pieces of wall (p, 2, 2), some at a time."""
    start, along = pieces[:, 0], pieces[:, 1] - pieces[:, 0]
    length = np.maximum(np.hypot(*along.T), 1e-9)
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / length[:, None]
    offset = (start * normal).sum(axis=1)
    step = max(1, CELLS_AT_ONCE // max(len(pieces), 1))
    for low in range(0, len(seen.points), step):
        part = slice(low, low + step)
        eye, point = seen.eyes[part], seen.points[part]
        from_m, to_m = eye @ normal.T - offset, point @ normal.T - offset
        margin_m = THROUGH_M + THROUGH_SIGMAS * sigma_m[part, None]
        through = (from_m * to_m < 0) & (np.abs(to_m) > margin_m)
        share = from_m / np.where(through, from_m - to_m, 1.0)
        met = (eye @ along.T) + share * ((point - eye) @ along.T) - (start * along).sum(axis=1)
        yield part, through & (met > 0) & (met < length**2)


def _pieces(
    x: Unknowns, points: Array, wall_of: Indices, opening_m: float
) -> tuple[Indices, Indices, Array]:
    """Hits that have a wall (h,), the piece of each (h,), and the pieces' ends (p, 2, 2)."""
    hit = np.flatnonzero(wall_of != NO_WALL)
    order, along, is_first = in_rows(x, points[hit], wall_of[hit], opening_m)
    hit = hit[order]
    wall = wall_of[hit]
    is_first |= np.diff(np.floor(along / STRETCH_M), prepend=0) != 0
    first = np.flatnonzero(is_first)
    last = np.append(first[1:], len(hit)) - 1 if len(first) else first
    of_piece = wall[first]
    foot = (x.walls[:, 1:] * x.normals)[of_piece]
    direction = x.tangents[of_piece]
    ends = (
        foot[:, None]
        + np.stack([along[first], along[last]], axis=1)[..., None] * direction[:, None]
    )
    return hit, np.cumsum(is_first) - 1, ends

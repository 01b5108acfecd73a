"""Joins the pieces of a wall in flight, so that it is drawn, counted and labelled once.

Until the end of a flight, each visit of a wall may have left a piece of its own, beside or over the
others. Pieces of the other side of a wall have the other direction, and stay apart.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from companion.core.arrays import Array
from companion.core.messages import WallSegment
from companion.mapping.floor_plan import MIN_OPENING_M

SAME_DIRECTION = math.cos(math.radians(5))
"""Cosine of the largest angle between pieces of a wall. Chosen."""
OFF_M = 0.15
"""Largest distance of a piece from the line of the wall, m. Chosen: three sigmas."""


def joined(walls: Sequence[WallSegment]) -> tuple[WallSegment, ...]:
    """The walls, each along its longest piece."""
    whole: list[WallSegment] = []
    lines: Array = np.empty((0, 3, 2))
    """(n, 3, 2): start, end and direction of each."""
    for piece in sorted(walls, key=lambda wall: -wall.length_m):
        number = _wall_of(lines, _line(piece))
        if number is None:
            whole.append(piece)
            lines = np.concatenate([lines, _line(piece)[None]])
        else:
            whole[number] = _longer(whole[number], piece)
            lines[number] = _line(whole[number])
    return tuple(whole)


def _line(wall: WallSegment) -> Array:
    start, end = np.array(wall.start_ne_m), np.array(wall.end_ne_m)
    return np.array([start, end, (end - start) / max(wall.length_m, 1e-9)])


def _wall_of(lines: Array, piece: Array) -> int | None:
    """Index of the wall that a piece belongs to; None without one."""
    starts, ends, along = lines[:, 0], lines[:, 1], lines[:, 2]
    across = np.column_stack([-along[:, 1], along[:, 0]])
    off_m = piece[:2] - starts[:, None]  # (n, 2, 2): to both ends of the piece
    at_m = np.einsum("nij,nj->ni", off_m, along)
    aside_m = np.abs(np.einsum("nij,nj->ni", off_m, across)).max(axis=1)
    length_m = np.einsum("nj,nj->n", ends - starts, along)
    gap_m = np.maximum(at_m.min(axis=1) - length_m, -at_m.max(axis=1))
    is_same = (along @ piece[2] > SAME_DIRECTION) & (aside_m < OFF_M) & (gap_m < MIN_OPENING_M)
    found = np.flatnonzero(is_same)
    return int(found[np.argmin(aside_m[found])]) if len(found) else None


def _longer(wall: WallSegment, piece: WallSegment) -> WallSegment:
    """The wall, extended to the ends of a piece."""
    start, _, along = _line(wall)
    at_m = [float((np.array(end) - start) @ along) for end in (piece.start_ne_m, piece.end_ne_m)]
    first, last = (start + along * each for each in (min(0.0, *at_m), max(wall.length_m, *at_m)))
    return replace(
        wall,
        start_ne_m=(float(first[0]), float(first[1])),
        end_ne_m=(float(last[0]), float(last[1])),
        hits=wall.hits + piece.hits,
    )

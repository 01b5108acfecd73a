"""From wall lines with hits along them to wall segments with ends and corners."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import Vector2, wrap_rad
from companion.core.messages import WallLine, WallSegment

Along = NDArray[np.float64]
"""(n,): coordinates along a line, metres."""

LARGEST_GAP_M = 0.6
"""Hits farther apart than this along a wall leave an opening between them."""
MIN_HITS = 5
TOGETHER_SHARE, TOGETHER_SPACINGS = 0.5, 6.0
"""Within so much of the largest gap, or so many usual spacings, there is another hit where there is
wall; one by itself may be of something else that the line passes by, or seen through a doorway."""
MIN_LENGTH_M = 0.2
CORNER_REACH_M = 0.5
"""Two ends this close to where their lines meet are one corner."""
MIN_SIN_BETWEEN = math.sin(math.radians(15))


def wall_segments(
    lines: Sequence[WallLine],
    points_ne_m: NDArray[np.float64],
    wall_of: NDArray[np.int64],
    largest_gap_m: float = LARGEST_GAP_M,
) -> tuple[WallSegment, ...]:
    """Straight pieces of wall where hits (n, 2) lie along the lines, joined at corners.

    `wall_of` (n,) is the line that each hit is on, or negative.
    """
    rows = [
        (line, row)
        for i, line in enumerate(lines)
        for row in _rows(_along(line, points_ne_m[wall_of == i]), largest_gap_m)
    ]
    pieces = [_segment(line, _without_overhang(line, row, rows)) for line, row in rows]
    for first, second in combinations(range(len(pieces)), 2):
        corner = _meeting_point(rows[first][0], rows[second][0])
        one, other = (_with_end_at(pieces[i], corner) for i in (first, second))
        if one and other:
            pieces[first], pieces[second] = one, other
    return tuple(piece for piece in pieces if piece.length_m >= MIN_LENGTH_M)


def _along(line: WallLine, points_ne_m: NDArray[np.float64]) -> Along:
    """The sorted coordinates p·t, t = (-sin, cos)(normal), of hits on a line."""
    return np.sort(points_ne_m @ (-math.sin(line.normal_rad), math.cos(line.normal_rad)))


def _rows(along_m: Along, largest_gap_m: float) -> list[Along]:
    """Sorted coordinates, parted where there are gaps."""
    along_m = _without_lonely(along_m, TOGETHER_SHARE * largest_gap_m)
    gaps = np.flatnonzero(np.diff(along_m) > largest_gap_m) + 1
    return [row for row in np.split(along_m, gaps) if len(row) >= MIN_HITS]


def _without_overhang(line: WallLine, row: Along, rows: Sequence[tuple[WallLine, Along]]) -> Along:
    """Without the few hits beyond another wall: they are of that, or of what is beside it."""
    for other, its_row in rows:
        meeting = _meeting_point(line, other)
        if meeting is None:
            continue
        at_m, its_at_m = (_along(one, np.array([meeting]))[0] for one in (line, other))
        if not its_row[0] - CORNER_REACH_M < its_at_m < its_row[-1] + CORNER_REACH_M:
            continue
        for kept in (row[row <= at_m], row[row >= at_m]):
            if len(row) > len(kept) > max(len(row), 2 * MIN_HITS) - MIN_HITS:
                row = kept
    return row


def _segment(line: WallLine, row: Along) -> WallSegment:
    return WallSegment(
        _point(line, float(row[0])),
        _point(line, float(row[-1])),
        line.sigma_at_m(0.5 * float(row[0] + row[-1])),
        len(row),
        line.normal_sigma_rad,
    )


def _without_lonely(along_m: Along, together_m: float) -> Along:
    """Sorted coordinates without those that have no other near."""
    if len(along_m) < MIN_HITS:
        return along_m
    apart_m = np.diff(along_m)
    is_near = apart_m <= max(together_m, TOGETHER_SPACINGS * float(np.median(apart_m)))
    together: Along = along_m[np.append(is_near, False) | np.append(False, is_near)]
    return together


def _point(line: WallLine, along_m: float) -> Vector2:
    cos_n, sin_n = math.cos(line.normal_rad), math.sin(line.normal_rad)
    return line.offset_m * cos_n - along_m * sin_n, line.offset_m * sin_n + along_m * cos_n


def _with_end_at(segment: WallSegment, corner: Vector2 | None) -> WallSegment | None:
    """The segment, its nearer end moved to the corner, if that is near."""
    if corner is None:
        return None
    to_start = math.dist(segment.start_ne_m, corner)
    to_end = math.dist(segment.end_ne_m, corner)
    if min(to_start, to_end) > CORNER_REACH_M:
        return None
    if to_start < to_end:
        return replace(segment, start_ne_m=corner)
    return replace(segment, end_ne_m=corner)


def _meeting_point(a: WallLine, b: WallLine) -> Vector2 | None:
    """Of two lines; None if they are nearly parallel."""
    sin_between = math.sin(b.normal_rad - a.normal_rad)
    if abs(sin_between) < MIN_SIN_BETWEEN:
        return None
    north_m = a.offset_m * math.sin(b.normal_rad) - b.offset_m * math.sin(a.normal_rad)
    east_m = b.offset_m * math.cos(a.normal_rad) - a.offset_m * math.cos(b.normal_rad)
    return north_m / sin_between, east_m / sin_between


def outline_closed(walls: tuple[WallSegment, ...], viewpoint_ne_m: Vector2) -> float:
    """Share of all directions from a viewpoint in which the map has a wall, 0 to 1.

    What the drone can know of its coverage while it flies: 1 once the outline has no gap left.
    """
    degrees: set[int] = set()
    for wall in walls:
        bearings = [
            math.atan2(end[1] - viewpoint_ne_m[1], end[0] - viewpoint_ne_m[0])
            for end in (wall.start_ne_m, wall.end_ne_m)
        ]
        start_deg = round(math.degrees(bearings[0]))
        sweep_deg = round(math.degrees(wrap_rad(bearings[1] - bearings[0])))
        step = 1 if sweep_deg >= 0 else -1
        degrees.update((start_deg + step * i) % 360 for i in range(abs(sweep_deg)))
    return len(degrees) / 360

"""Builds wall segments with ends and corners from wall lines and their hits."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from companion.core.arrays import Array, Indices
from companion.core.frames import Vector2, wrap_rad
from companion.core.messages import WallLine, WallSegment

MIN_OPENING_M = 0.6
"""Minimum width of an opening, m: a larger gap between hits along a wall. Chosen."""
MIN_HITS = 5
"""Least hits of a segment. Chosen."""
NEIGHBOUR_SHARE, NEIGHBOUR_SPACINGS = 0.5, 6.0
"""A hit without another within this share of the largest gap, or within this many median spacings,
is dropped. Chosen: it may be on another surface that the line crosses, or behind a doorway."""
MIN_LENGTH_M = 0.2
"""Least length of a segment, m. Chosen."""
CORNER_REACH_M = 0.5
"""Ends of two segments within this distance of their lines' intersection form a corner, m.
Chosen."""
MIN_SIN_BETWEEN = math.sin(math.radians(15))
"""Sine of the least angle between lines that form a corner. Chosen: 15°."""


def wall_segments(
    lines: Sequence[WallLine],
    points_ne_m: Array,
    wall_of: Indices,
    min_opening_m: float = MIN_OPENING_M,
) -> tuple[WallSegment, ...]:
    """Straight pieces of wall along the lines where they have hits (n, 2), joined at corners.

    `wall_of` (n,): index of the line of each hit, or negative.
    """
    rows = [
        (line, row)
        for i, line in enumerate(lines)
        for row in _rows(_along(line, points_ne_m[wall_of == i]), min_opening_m)
    ]
    pieces = [_segment(line, _without_overhang(line, row, rows)) for line, row in rows]
    for first, second in combinations(range(len(pieces)), 2):
        corner = _intersection(rows[first][0], rows[second][0])
        one, other = (_with_end_at(pieces[i], corner) for i in (first, second))
        if one and other:
            pieces[first], pieces[second] = one, other
    return tuple(piece for piece in pieces if piece.length_m >= MIN_LENGTH_M)


def _along(line: WallLine, points_ne_m: Array) -> Array:
    """Sorted coordinates p·t, t = (-sin, cos)(normal), of hits on a line."""
    return np.sort(points_ne_m @ (-math.sin(line.normal_rad), math.cos(line.normal_rad)))


def _rows(along_m: Array, min_opening_m: float) -> list[Array]:
    """Split sorted coordinates at gaps."""
    along_m = _without_isolated(along_m, NEIGHBOUR_SHARE * min_opening_m)
    gaps = np.flatnonzero(np.diff(along_m) > min_opening_m) + 1
    return [row for row in np.split(along_m, gaps) if len(row) >= MIN_HITS]


def _without_overhang(line: WallLine, row: Array, rows: Sequence[tuple[WallLine, Array]]) -> Array:
    """Drop the few hits beyond a crossing wall: they belong to that wall or to an adjacent one."""
    for other, its_row in rows:
        intersection = _intersection(line, other)
        if intersection is None:
            continue
        at_m, its_at_m = (_along(one, np.array([intersection]))[0] for one in (line, other))
        if not its_row[0] - CORNER_REACH_M < its_at_m < its_row[-1] + CORNER_REACH_M:
            continue
        for kept in (row[row <= at_m], row[row >= at_m]):
            if len(row) > len(kept) > max(len(row), 2 * MIN_HITS) - MIN_HITS:
                row = kept
    return row


def _segment(line: WallLine, row: Array) -> WallSegment:
    return WallSegment(
        _point(line, float(row[0])),
        _point(line, float(row[-1])),
        line.sigma_at_m(0.5 * float(row[0] + row[-1])),
        len(row),
        line.normal_sigma_rad,
    )


def _without_isolated(along_m: Array, neighbour_m: float) -> Array:
    """Drop coordinates without another one nearby."""
    if len(along_m) < MIN_HITS:
        return along_m
    spacing_m = np.diff(along_m)
    is_near = spacing_m <= max(neighbour_m, NEIGHBOUR_SPACINGS * float(np.median(spacing_m)))
    neighbours: Array = along_m[np.append(is_near, False) | np.append(False, is_near)]
    return neighbours


def _point(line: WallLine, along_m: float) -> Vector2:
    cos_n, sin_n = math.cos(line.normal_rad), math.sin(line.normal_rad)
    return line.offset_m * cos_n - along_m * sin_n, line.offset_m * sin_n + along_m * cos_n


def _with_end_at(segment: WallSegment, corner: Vector2 | None) -> WallSegment | None:
    """The segment with its nearer end moved to the corner; None if the corner is not near."""
    if corner is None:
        return None
    to_start = math.dist(segment.start_ne_m, corner)
    to_end = math.dist(segment.end_ne_m, corner)
    if min(to_start, to_end) > CORNER_REACH_M:
        return None
    if to_start < to_end:
        return replace(segment, start_ne_m=corner)
    return replace(segment, end_ne_m=corner)


def _intersection(a: WallLine, b: WallLine) -> Vector2 | None:
    """Intersection of two lines; None if they are nearly parallel."""
    sin_between = math.sin(b.normal_rad - a.normal_rad)
    if abs(sin_between) < MIN_SIN_BETWEEN:
        return None
    north_m = a.offset_m * math.sin(b.normal_rad) - b.offset_m * math.sin(a.normal_rad)
    east_m = b.offset_m * math.cos(a.normal_rad) - a.offset_m * math.cos(b.normal_rad)
    return north_m / sin_between, east_m / sin_between


def outline_closed(walls: tuple[WallSegment, ...], viewpoint_ne_m: Vector2) -> float:
    """Share of all directions from a viewpoint in which the map has a wall, 0 to 1.

    An estimate of the coverage without ground truth: 1 for a closed outline.
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

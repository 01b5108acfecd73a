"""From wall lines with hits along them to wall segments with ends and corners."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from companion.frames import Vector2, wrap_rad
from companion.messages import WallLine, WallSegment

LARGEST_GAP_M = 0.6
"""Hits farther apart than this along a wall leave an opening between them."""
LEAST_HITS = 5
TOGETHER_M, TOGETHER_SPACINGS = 0.3, 6.0
"""So near to a hit, or within so many usual spacings, there is another where there is wall; one by
itself may be of something else that the line passes by, or seen through a doorway."""
LEAST_LENGTH_M = 0.2
CORNER_REACH_M = 0.5
"""Two ends this close to where their lines meet are one corner."""


def wall_segments(
    lines: Sequence[WallLine],
    points_ne_m: NDArray[np.float64],
    wall_of: NDArray[np.int64],
    largest_gap_m: float = LARGEST_GAP_M,
) -> tuple[WallSegment, ...]:
    """Straight pieces of wall where hits (n, 2) lie along the lines, joined at corners.

    `wall_of` (n,) is the line that each hit is on, or negative.
    """
    pieces = [
        piece
        for i, line in enumerate(lines)
        for piece in _pieces(line, _along(line, points_ne_m[wall_of == i]), largest_gap_m)
    ]
    for first, second in combinations(range(len(pieces)), 2):
        joined = _join(pieces[first], pieces[second])
        if joined:
            pieces[first], pieces[second] = joined
    return tuple(piece for piece in pieces if piece.length_m >= LEAST_LENGTH_M)


def _along(line: WallLine, points_ne_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """The sorted coordinates p·t, t = (-sin, cos)(normal), of hits on a line."""
    return np.sort(points_ne_m @ (-math.sin(line.normal_rad), math.cos(line.normal_rad)))


def _pieces(
    line: WallLine, along_m: NDArray[np.float64], largest_gap_m: float
) -> list[WallSegment]:
    along_m = _without_lonely(along_m)
    gaps = np.flatnonzero(np.diff(along_m) > largest_gap_m) + 1
    return [
        WallSegment(
            _point(line, float(row[0])),
            _point(line, float(row[-1])),
            line.sigma_at_m(0.5 * float(row[0] + row[-1])),
            len(row),
            line.normal_sigma_rad,
        )
        for row in np.split(along_m, gaps)
        if len(row) >= LEAST_HITS
    ]


def _without_lonely(along_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sorted coordinates without those that have no other near."""
    if len(along_m) < LEAST_HITS:
        return along_m
    apart_m = np.diff(along_m)
    is_near = apart_m <= max(TOGETHER_M, TOGETHER_SPACINGS * float(np.median(apart_m)))
    together: NDArray[np.float64] = along_m[np.append(is_near, False) | np.append(False, is_near)]
    return together


def _point(line: WallLine, along_m: float) -> Vector2:
    cos_n, sin_n = math.cos(line.normal_rad), math.sin(line.normal_rad)
    return line.offset_m * cos_n - along_m * sin_n, line.offset_m * sin_n + along_m * cos_n


def _join(a: WallSegment, b: WallSegment) -> tuple[WallSegment, WallSegment] | None:
    """Both with their nearest ends moved to where their lines meet, if that is near both."""
    corner = _meeting_point(a, b)
    if corner is None:
        return None
    moved = [_with_end_at(segment, corner) for segment in (a, b)]
    return (moved[0], moved[1]) if moved[0] and moved[1] else None


def _with_end_at(segment: WallSegment, corner: Vector2) -> WallSegment | None:
    to_start = math.dist(segment.start_ne_m, corner)
    to_end = math.dist(segment.end_ne_m, corner)
    if min(to_start, to_end) > CORNER_REACH_M:
        return None
    if to_start < to_end:
        return replace(segment, start_ne_m=corner)
    return replace(segment, end_ne_m=corner)


def _meeting_point(a: WallSegment, b: WallSegment) -> Vector2 | None:
    (ax, ay), (bx, by) = _direction(a), _direction(b)
    cross = ax * by - ay * bx
    if abs(cross) < math.sin(math.radians(15)):
        return None
    dx = b.start_ne_m[0] - a.start_ne_m[0]
    dy = b.start_ne_m[1] - a.start_ne_m[1]
    along_a = (dx * by - dy * bx) / cross
    return a.start_ne_m[0] + along_a * ax, a.start_ne_m[1] + along_a * ay


def _direction(segment: WallSegment) -> Vector2:
    length_m = segment.length_m or 1.0
    return (
        (segment.end_ne_m[0] - segment.start_ne_m[0]) / length_m,
        (segment.end_ne_m[1] - segment.start_ne_m[1]) / length_m,
    )


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

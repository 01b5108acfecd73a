"""Triangulates polygons, also hollow ones: a wall around a doorway is often one polygon."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from companion.core.arrays import Array
from sitl.world.importers.formats import MeshError

MAX_CORNERS = 500
"""Largest number of corners of a hollow polygon; the time grows with its square. Chosen."""

Vertices = Sequence[Sequence[float]]
Triangle = tuple[int, int, int]


def triangles(corners: Sequence[int], vertices: Vertices) -> Iterator[Triangle]:
    """Triangulate one polygon of corner numbers; fewer than three give a triangle without area.

    Raises:
        MeshError: the polygon is hollow and has too many corners.
    """
    if len(corners) <= 3:
        a, b, c = (*corners, *[corners[-1]] * (3 - len(corners)))
        yield a, b, c
        return
    if all(0 <= number < len(vertices) for number in corners):
        points = np.array([vertices[number] for number in corners])
        if np.isfinite(points).all() and not _is_fan(points):
            yield from _cut(corners, points)
            return
    for second, third in pairwise(corners[1:]):
        yield corners[0], second, third


def _is_fan(points: Array) -> bool:
    """All triangles from the first corner turn the same way, so that none overlaps another."""
    off = points[1:] - points[0]
    normals = np.cross(off[:-1], off[1:])
    return bool((normals @ normals.sum(axis=0) >= 0).all())


def _cut(corners: Sequence[int], points: Array) -> Iterator[Triangle]:
    """Triangles by ear clipping."""
    if len(corners) > MAX_CORNERS:
        raise MeshError(f"has a hollow face of {len(corners)} corners; export triangles")
    flat, left = _flat(points), list(range(len(corners)))
    while len(left) > 3:
        ear = _ear(flat[left])
        before, after = left[ear - 1], left[(ear + 1) % len(left)]
        yield corners[before], corners[left[ear]], corners[after]
        del left[ear]
    a, b, c = left
    yield corners[a], corners[b], corners[c]


def _flat(points: Array) -> Array:
    """The polygon projected along its axis of largest area, (n, 2), turning left."""
    off = points - points[0]
    normal = np.cross(off, np.roll(off, -1, axis=0)).sum(axis=0)  # Newell
    axis = int(np.abs(normal).argmax())
    flat: Array = points[:, [i for i in range(3) if i != axis]]
    turns_left = normal[axis] * (-1 if axis == 1 else 1) > 0
    return flat if turns_left else flat * np.array([1.0, -1.0])


def _ear(ring: Array) -> int:
    """Number of a corner to clip: convex, with no other corner in its triangle."""
    before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
    turns = _cross(before, ring, after)
    for number in np.flatnonzero(turns > 0):
        three = before[number], ring[number], after[number]
        a, b, c = three
        inside = (_cross(a, b, ring) >= 0) & (_cross(b, c, ring) >= 0) & (_cross(c, a, ring) >= 0)
        is_corner = np.any([(ring == corner).all(axis=1) for corner in three], axis=0)
        if not (inside & ~is_corner).any():
            return int(number)
    return int(np.abs(turns).argmin())  # self-intersecting: clip the smallest


def _cross(a: Array, b: Array, c: Array) -> Array:
    """Positive where a, b, c turn left."""
    (ax, ay), (bx, by), (cx, cy) = a.T, b.T, c.T
    turn: Array = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    return turn

"""Joins segments to polylines and simplifies polylines.

Plan points are rows of (n, 2) arrays. A polyline that ends at its first point is a loop.
"""

from collections import defaultdict
from itertools import pairwise

import numpy as np

from companion.core.arrays import Array, Indices
from companion.core.frames import Vector2


def join(segments: Array, same_within: float) -> list[Array]:
    """Join segments (n, 2, 2) that meet end to end.

    Ends within `same_within` are the same point. A polyline ends where not exactly two segments
    meet. Every segment is in exactly one polyline; repeated and zero-length ones are dropped.
    """
    if not len(segments):
        return []
    keys = np.round(segments.reshape(-1, 2) / same_within).astype(np.int64)
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    edges = np.sort(number.reshape(-1, 2), axis=1)
    edges = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0)
    points = segments.reshape(-1, 2)[first]
    return [points[walk] for walk in _Walker(edges).walks()]


class _Walker:
    """Traverses every edge (pair of vertex numbers) of a graph once."""

    def __init__(self, edges: Indices) -> None:
        self._edges: list[tuple[int, int]] = [(a, b) for a, b in edges.tolist()]
        self._walked = [False] * len(self._edges)
        self._at: dict[int, list[int]] = defaultdict(list)
        for number, ends in enumerate(self._edges):
            for vertex in ends:
                self._at[vertex].append(number)

    def walks(self) -> list[list[int]]:
        """All walks, those from crossings and ends first; the remaining edges are loops."""
        crossings = [vertex for vertex, edges in self._at.items() if len(edges) != 2]
        return [
            self._walk(vertex, edge)
            for vertex in (*crossings, *self._at)
            for edge in self._at[vertex]
            if not self._walked[edge]
        ]

    def _walk(self, vertex: int, edge: int) -> list[int]:
        walk = [vertex]
        while not self._walked[edge]:
            self._walked[edge] = True
            a, b = self._edges[edge]
            vertex = b if vertex == a else a
            walk.append(vertex)
            if len(self._at[vertex]) == 2:
                one, other = self._at[vertex]
                edge = other if edge == one else one
        return walk


def simplify(points: Array, tolerance: float) -> Array:
    """Douglas and Peucker 1973: every dropped point is within the tolerance of the result."""
    middle = 0
    if is_loop(points):
        points = _from_a_corner(points)
        middle = int(np.linalg.norm(points - points[0], axis=1).argmax())
    last = len(points) - 1
    keep = np.zeros(len(points), dtype=bool)
    keep[[0, middle, last]] = True
    spans = [(0, middle), (middle, last)]
    while spans:
        start, end = spans.pop()
        if end - start < 2:
            continue
        distance = _distance(points[start + 1 : end], points[start], points[end])
        worst = int(distance.argmax())
        if distance[worst] > tolerance:
            split = start + 1 + worst
            keep[split] = True
            spans += [(start, split), (split, end)]
    return points[keep]


def legs(points: Array) -> list[tuple[Vector2, Vector2]]:
    """Segments between consecutive points."""
    return list(pairwise((float(x), float(y)) for x, y in points))


def is_loop(points: Array) -> bool:
    """The polyline ends at its first point."""
    return bool((points[0] == points[-1]).all())


def _from_a_corner(loop: Array) -> Array:
    """The same loop, starting at the point farthest from its start, which is always a corner."""
    farthest = int(np.linalg.norm(loop - loop[0], axis=1).argmax())
    ring = np.roll(loop[:-1], -farthest, axis=0)
    return np.concatenate([ring, ring[:1]])


def _distance(points: Array, start: Array, end: Array) -> Array:
    """Distance of each point to the segment."""
    along = end - start
    length2 = max(float(along @ along), 1e-18)
    share = np.clip((points - start) @ along / length2, 0, 1)
    distance: Array = np.linalg.norm(points - start - share[:, None] * along, axis=1)
    return distance

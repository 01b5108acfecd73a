"""Reads mesh files: triangles and their places, and nothing else.

A reader reads all of a file correctly or rejects it: a building that silently lacks a part would be
wrong.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from companion.core.arrays import Array, Indices


class MeshError(ValueError):
    """A file cannot be read correctly; the text has the cause and the remedy."""


class Part(NamedTuple):
    """Triangles of one part."""

    vertices: Array
    """(n, 3), in the file's axes."""
    faces: Indices
    """(m, 3) of vertex numbers; missing vertices have numbers below 0 or beyond the last."""


def part(vertices: Iterable[Iterable[float]], faces: Iterable[Iterable[int]]) -> Part:
    """Build a part from lists."""
    return Part(
        np.array(list(vertices), dtype=float).reshape(-1, 3),
        np.array(list(faces), dtype=np.int64).reshape(-1, 3),
    )


def strip(numbers: Indices) -> Indices:
    """Triangles of a strip: each number with the two before it; (n,) to (n - 2, 3)."""
    return np.column_stack([numbers[:-2], numbers[1:-1], numbers[2:]])


def fan(numbers: Indices) -> Indices:
    """Triangles of a fan: the first number with each pair of neighbours; (n,) to (n - 2, 3)."""
    return np.column_stack([np.full(max(len(numbers) - 2, 0), numbers[:1]), *_pairs(numbers[1:])])


def _pairs(numbers: Indices) -> tuple[Indices, Indices]:
    return numbers[:-1], numbers[1:]

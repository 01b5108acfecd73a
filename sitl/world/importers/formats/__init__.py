"""Readers of mesh files: triangles and where they stand, and nothing else.

Each reads all of a file as it is meant, or refuses it: a building of which a part is left out
without a word is worse than none.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
Faces = NDArray[np.int64]


class MeshError(ValueError):
    """A file that cannot be read as it is meant; says why, and what to do."""


class Part(NamedTuple):
    """Triangles of one piece."""

    vertices: Points
    """(n, 3), in the file's axes."""
    faces: Faces
    """(m, 3): numbers of vertices; those that do not exist are below 0 or beyond the last."""


def part(vertices: Iterable[Iterable[float]], faces: Iterable[Iterable[int]]) -> Part:
    """From lists."""
    return Part(
        np.array(list(vertices), dtype=float).reshape(-1, 3),
        np.array(list(faces), dtype=np.int64).reshape(-1, 3),
    )


def strip(numbers: Faces) -> Faces:
    """Each with the two before it; (n,) to (n - 2, 3)."""
    return np.column_stack([numbers[:-2], numbers[1:-1], numbers[2:]])


def fan(numbers: Faces) -> Faces:
    """Each pair of neighbours with the first; (n,) to (n - 2, 3)."""
    return np.column_stack([np.full(max(len(numbers) - 2, 0), numbers[:1]), *_pairs(numbers[1:])])


def _pairs(numbers: Faces) -> tuple[Faces, Faces]:
    return numbers[:-1], numbers[1:]

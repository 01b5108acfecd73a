"""Compressed copies of an occupancy grid.

The drone keeps many copies of its grid, and of the grids of its teammates. Most cells of one are
equal to their neighbours, so a copy takes a thirtieth of the memory.
"""

import zlib
from typing import Any, Self

import numpy as np
from numpy.typing import DTypeLike, NDArray

from companion.core.values import value
from companion.mapping.occupancy import Occupancy

QUICKLY = 1
"""Level of compression: a copy takes a few milliseconds."""


@value
class _PackedArray:
    """An array, compressed."""

    dtype: DTypeLike
    shape: tuple[int, ...]
    content: bytes

    @classmethod
    def of(cls, array: NDArray[Any]) -> Self:
        return cls(array.dtype, array.shape, zlib.compress(array.tobytes(), QUICKLY))

    def unpacked(self) -> NDArray[Any]:
        flat = np.frombuffer(bytearray(zlib.decompress(self.content)), self.dtype)
        return flat.reshape(self.shape)


@value
class PackedGrid:
    """A copy of a grid, compressed."""

    arrays: dict[str, _PackedArray]
    """All content by name, as in `Occupancy.arrays`."""

    @classmethod
    def of(cls, grid: Occupancy) -> Self:
        return cls({name: _PackedArray.of(array) for name, array in grid.arrays().items()})

    def unpacked(self) -> Occupancy:
        """The grid as it was."""
        return Occupancy.of_arrays({name: each.unpacked() for name, each in self.arrays.items()})

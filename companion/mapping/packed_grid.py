"""Stores copies of an occupancy grid without the cells that were never measured.

A grid grows by whole chunks, and the drone keeps many copies of it, and of the grids of its
teammates. Of a grid that fits one building, a third to a half is measured.
"""

from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from companion.core.arrays import Mask
from companion.core.values import value
from companion.mapping.occupancy import Occupancy

WHERE = "low", "is_all_allowed"
"""Content of a grid that is not of its cells."""


@value
class PackedGrid:
    """A copy of a grid, of which only the used part is stored."""

    shape: tuple[int, int]
    """Of the whole grid."""
    part: tuple[slice, slice]
    """Rows and columns of the used part."""
    where: dict[str, NDArray[Any]]
    cells: dict[str, NDArray[Any]]
    """Of the used part, by name."""

    @classmethod
    def of(cls, grid: Occupancy) -> Self:
        arrays = grid.arrays()
        where = {name: arrays.pop(name) for name in WHERE}
        unused = _unused(where)
        is_used = np.any([arrays[name] != unused[name] for name in arrays], axis=0)
        part = _range(is_used.any(axis=1)), _range(is_used.any(axis=0))
        return cls(
            grid.shape, part, where, {name: cells[part].copy() for name, cells in arrays.items()}
        )

    def unpacked(self) -> Occupancy:
        """The grid as it was."""
        unused, whole = _unused(self.where), {}
        for name, cells in self.cells.items():
            whole[name] = np.full(self.shape, unused[name], dtype=cells.dtype)
            whole[name][self.part] = cells
        return Occupancy.of_arrays(self.where | whole)


def _unused(where: dict[str, NDArray[Any]]) -> dict[str, float]:
    """Content of a cell that was never measured, by name."""
    unmeasured = dict.fromkeys(("log_odds", "well_seen", "flown", "met_s"), 0.0)
    return {**unmeasured, "allowed": float(where["is_all_allowed"])}


def _range(is_used: Mask) -> slice:
    """From the first to the last used row or column; empty if none is used."""
    used = np.flatnonzero(is_used)
    return slice(int(used[0]), int(used[-1]) + 1) if len(used) else slice(0, 0)

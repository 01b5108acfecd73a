"""Joins the grid of this drone with those of its teammates."""

import math
from collections.abc import Callable, Collection, Sequence

import numpy as np
from scipy.ndimage import binary_closing, binary_dilation, distance_transform_edt

from companion.core.arrays import Array, Mask
from companion.core.frames import Vector2
from companion.mapping.occupancy import (
    CELL_M,
    FREE_BELOW,
    GAP_CELLS,
    MAX_LOG_ODDS,
    OCCUPIED_ABOVE,
    Occupancy,
)

OPENING_M = 0.9
"""Radius of the disc, m. Chosen: more than half the width of a doorway."""


class JoinedGrid:
    """The joined grid in flight: joined anew only when one of the grids has changed."""

    def __init__(self) -> None:
        self._of: list[tuple[Occupancy, int]] = []
        """The grids that are joined, each with its number of changes."""
        self._grid = Occupancy()

    def of(self, own: Occupancy, others: Sequence[Occupancy]) -> Occupancy:
        """As `joined`; the caller must not change the grid."""
        grids = [(grid, grid.changes) for grid in (own, *others)]
        if grids != self._of:
            self._of, self._grid = grids, joined(own, others)
        return self._grid


def joined(own: Occupancy, others: Sequence[Occupancy]) -> Occupancy:
    """The own grid, with what other drones have measured where it is unknown.

    What this drone has measured counts alone: its own sensors look at its own height and time.
    """
    grids = [grid.arrays() for grid in (own, *others)]
    low = np.min([grid["low"] for grid in grids], axis=0)
    high = np.max([grid["low"] + grid["log_odds"].shape for grid in grids], axis=0)
    parts = [_part(grid["low"] - low, grid["log_odds"].shape) for grid in grids]
    union = {
        name: np.zeros(high - low, dtype=grids[0][name].dtype)
        for name in ("log_odds", "well_seen", "flown", "met_s")
    }
    for grid, part in zip(grids[1:], parts[1:], strict=True):
        union["log_odds"][part] += grid["log_odds"]
        union["well_seen"][part] |= grid["well_seen"]
        union["met_s"][part][grid["met_s"] != 0] = -math.inf
    first, part = grids[0], parts[0]
    log_odds, met_s = first["log_odds"], first["met_s"]
    is_known = (log_odds < FREE_BELOW) | (log_odds > OCCUPIED_ABOVE)
    union["log_odds"][part] = log_odds + np.where(is_known, 0, union["log_odds"][part])
    np.clip(union["log_odds"], -MAX_LOG_ODDS, MAX_LOG_ODDS, out=union["log_odds"])
    union["well_seen"][part] |= first["well_seen"]
    union["flown"][part] = first["flown"]
    union["met_s"][part] = np.where(met_s != 0, met_s, union["met_s"][part])
    allowed = np.full(high - low, bool(first["is_all_allowed"]))
    allowed[part] = first["allowed"]
    where = {"low": low, "is_all_allowed": first["is_all_allowed"], "allowed": allowed}
    return Occupancy.of_arrays(union | where)


def _part(first: np.ndarray, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Rows and columns of a grid in the joined one."""
    row, column = first.tolist()
    return np.s_[row : row + shape[0], column : column + shape[1]]


def allowed_above(
    layers: Sequence[Occupancy],
    seen: Collection[int],
    low_ne_m: Callable[[int], Sequence[Vector2]],
) -> Occupancy:
    """The highest of some layers, where it may be flown: above free space of the layers below.

    `layers` begin with the lowest. One that was not seen completely forbids only where it has
    obstacles, except the lowest: its openings are shut until it was seen, as beams look through
    a doorway before any drone has passed below its lintel. `low_ne_m` returns the places where
    something hangs too low for a layer.
    """
    *below, highest = layers
    if not below:
        return highest
    free = below[0] if 0 in seen else below[0].with_obstacles(_openings_ne_m(below[0]))
    for number, grid in enumerate(below[1:], 1):
        if number in seen:
            free = free.layer_above(low_ne_m(number), grid)
        else:
            free = free.with_obstacles(centres(grid, grid.occupied))
    return free.layer_above(low_ne_m(len(below)), highest)


class AllowedAbove:
    """`allowed_above` in flight: made anew only when a layer or a low place has changed."""

    def __init__(self) -> None:
        self._of: object = None
        """The layers, those that were seen, and the low places of each."""
        self._grid = Occupancy()

    def of(
        self,
        layers: Sequence[Occupancy],
        seen: Collection[int],
        low_ne_m: Callable[[int], Sequence[Vector2]],
    ) -> Occupancy:
        """As `allowed_above`; neither the layers nor the result may be changed."""
        low = {number: low_ne_m(number) for number in range(1, len(layers))}
        given = list(layers), frozenset(seen), low
        if given != self._of:
            self._of, self._grid = given, allowed_above(layers, seen, low.__getitem__)
        return self._grid


def _openings_ne_m(grid: Occupancy) -> Array:
    """(n, 2): places of a map that are free, but not in a disc of free space, m."""
    free = binary_closing(grid.free, iterations=GAP_CELLS + 1) & ~grid.occupied
    wide = distance_transform_edt(free) * CELL_M >= OPENING_M
    if not wide.any():
        return centres(grid, free)
    return centres(grid, free & (distance_transform_edt(~wide) * CELL_M > OPENING_M))


def centres(grid: Occupancy, cells: Mask) -> Array:
    """(n, 2): middles of the cells of a mask, m."""
    corner_ne_m: Array = np.array(grid.place((0, 0)))
    return corner_ne_m + CELL_M * np.argwhere(cells)


def contradicted(other: Occupancy, own: Occupancy, within_m: float) -> tuple[int, int]:
    """Number of another grid's occupied cells in space that the own one knows, and of those free.

    A cell does not count as free within a distance of an occupied cell of the own grid.
    """
    near = binary_dilation(own.occupied, iterations=round(within_m / CELL_M))
    free = own.free & ~near
    cells = [
        cell
        for row, column in np.argwhere(other.occupied).tolist()
        if own.has(cell := own.cell(other.place((row, column))))
    ]
    return sum(near[cell] or free[cell] for cell in cells), sum(free[cell] for cell in cells)

"""Plans shortest paths through known free space, on a cost grid, with Dijkstra's algorithm.

The drone is modelled as a disc. It fits where all cells within its radius and clearance are known
to be free. It also fits where it has flown before, even if obstacles there have since moved by a
cell or two on the map.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, distance_transform_edt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from companion.core.arrays import Array, Mask
from companion.core.frames import Vector2
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.safety.separation import KeepOut

START_NE_M: Vector2 = (0.0, 0.0)
"""The place of take-off, origin of the local NED frame, m."""
TIGHT_CLEAR_M = 0.4
"""Minimum clearance of the drone's centre to the sides of a doorway, m. Chosen: the drone does not
enter an opening with less."""
DEEP_M = 0.7
"""Maximum distance into a narrow place from cells with full clearance, m. Chosen: no doorway is
deeper. In a long narrow corridor the sensors would measure neither side for too long."""
FLOWN_CLEAR_M = 0.3
"""Minimum clearance of cells where the drone has flown, m. Chosen: with more, no door has been
closed there."""
TIGHT_COST = 12.0
"""Cost of a metre in a narrow place, where a metre in the open costs 1. Chosen: the drone goes
there only to pass through."""
RETRACED_COST = 30.0
"""Cost of a metre through flown cells that the map now shows as blocked, on the same scale.
Chosen."""
NEIGHBOURS = ((0, 1, 1.0), (1, 0, 1.0), (1, 1, math.sqrt(2)), (1, -1, math.sqrt(2)))
"""Half of a cell's eight neighbours: rows down, columns right, distance in cells."""
CLOSE_COST = 4.0
"""Cost of a metre at the minimum clearance, on the same scale. Chosen."""
AMPLE_M = 0.9
"""Clearance above which more clearance does not justify a detour, m. Chosen."""
WAIT_COST = 12.0
"""Cost of a metre near a teammate with the right of way, on the same scale. Chosen: as in a narrow
place. To pass through its place costs as much as to wait 30 s for it to leave."""
OPEN_M = 0.5
"""Distance beyond the clearance from which a cell counts as open, m. Chosen."""


@dataclass(frozen=True, slots=True)
class CostGrid:
    """Cells where the drone fits, and the cost of passing them. Arrays are (rows, columns)."""

    grid: Occupancy
    """The measured part of the map."""
    start: tuple[int, int]
    """Row and column of the drone's cell."""
    passable: Mask
    """True where the drone fits."""
    room_m: Array
    """Distance to the nearest obstacle or unknown cell, m."""
    cost: Array
    """Cost of a metre through each cell; infinite where the drone does not fit."""
    kept_out: Mask
    """True near a teammate with the right of way."""

    def fits(self, place_ne_m: Vector2) -> bool:
        """True if the drone fits at a place."""
        cell = self.grid.cell(place_ne_m)
        return self.grid.has(cell) and bool(self.passable[cell])

    def fits_along(self, start_ne_m: Vector2, end_ne_m: Vector2) -> bool:
        """True if the drone fits on all of the straight line between two places."""
        steps = np.linspace(
            start_ne_m, end_ne_m, 2 + round(math.dist(start_ne_m, end_ne_m) / CELL_M)
        )
        return all(self.fits((north, east)) for north, east in steps.tolist())

    def clear_m(self, place_ne_m: Vector2) -> float:
        """Distance from a place to the nearest obstacle or unknown cell, m."""
        row, column = self.grid.cell(place_ne_m)
        return float(self.room_m[row, column])


@dataclass(frozen=True, slots=True)
class ShortestPaths:
    """Shortest paths from the drone's cell to all cells."""

    ground: CostGrid
    metres: Array
    """Cost of the path to each cell, (rows, columns); infinite without one. In the open this is the
    length in m."""
    came_from: NDArray[np.int32]
    """Flat index of each cell's predecessor on its path, (rows * columns,), or negative."""

    def reaches(self, place_ne_m: Vector2) -> bool:
        cell = self.ground.grid.cell(place_ne_m)
        return self.ground.grid.has(cell) and bool(np.isfinite(self.metres[cell]))

    def to(self, place_ne_m: Vector2) -> tuple[Vector2, ...]:
        """Corners of the straightened path to a place, local NED, m; the place is the last."""
        row, column = self.ground.grid.cell(place_ne_m)
        cells = [(row, column)]
        flat = row * self.metres.shape[1] + column
        while (before := int(self.came_from[flat])) >= 0:
            flat = before
            cells.append(divmod(flat, self.metres.shape[1]))
        cells.reverse()
        is_open = self.ground.passable & ~self.ground.kept_out
        corners = _straightened(cells, np.where(is_open, self.ground.room_m, 0.0))
        return (*(self.ground.grid.place(cell) for cell in corners[1:-1]), place_ne_m)

    def length_m(self, way: tuple[Vector2, ...]) -> float:
        """Length of a path from the drone's cell, m."""
        start = self.ground.grid.place(self.ground.start)
        return sum(math.dist(a, b) for a, b in pairwise((start, *way)))


def find_ground(grid: Occupancy, from_ne_m: Vector2, clear_m: float) -> CostGrid:
    """Cost grid from the map. The drone's own cell is always passable.

    `clear_m` is the minimum distance from the drone's centre to any obstacle, m. In doorways
    `TIGHT_CLEAR_M` is enough.
    """
    grid = grid.seen_part(from_ne_m, clear_m + CELL_M)
    room = distance_transform_edt(grid.free) * CELL_M
    tight_m = min(clear_m, TIGHT_CLEAR_M)
    passable: Mask = room >= tight_m
    row, column = grid.cell(from_ne_m)
    reach = math.ceil(clear_m / CELL_M)
    around = np.s_[row - reach : row + reach + 1, column - reach : column + reach + 1]
    passable[around] |= room[around] >= min(room[row, column], tight_m)
    deep_m = _deep_m(grid, room >= clear_m)
    passable &= deep_m <= max(DEEP_M, deep_m[row, column])
    passable |= _flown_before(grid, passable)
    if not grid.allowed.all():  # beams do not detect what forbids these cells: full clearance
        allowed_m = distance_transform_edt(grid.allowed) * CELL_M
        passable &= allowed_m >= clear_m
        passable[row, column] = True
        room = np.minimum(room, allowed_m)
    crowding = np.clip((clear_m + OPEN_M - room) / OPEN_M, 0, 1)
    cost = np.where(room < clear_m, TIGHT_COST, 1 + (CLOSE_COST - 1) * crowding)
    cost = np.where(passable, cost + (clear_m - room).clip(0) * TIGHT_COST, np.inf)
    return CostGrid(grid, (row, column), passable, room, cost, np.zeros_like(passable))


def _deep_m(grid: Occupancy, roomy: Mask) -> Array:
    """Distance from each cell to the nearest one with full clearance or the start, m."""
    from_here = roomy.copy()
    if grid.has(start := grid.cell(START_NE_M)):
        from_here[start] = True
    if not from_here.any():
        return np.zeros(roomy.shape)
    deep_m: Array = distance_transform_edt(~from_here) * CELL_M
    return deep_m


def _flown_before(grid: Occupancy, passable: Mask) -> Mask:
    """Cells where the drone has flown that are not passable now, but have no obstacle near."""
    flown: Mask = binary_dilation(grid.flown) & ~passable
    if not flown.any():
        return flown
    may: Mask = flown & (distance_transform_edt(~grid.occupied) * CELL_M >= FLOWN_CLEAR_M)
    return may


def retraced(ground: CostGrid) -> CostGrid:
    """The cost grid with all flown cells passable, whatever the map contains there.

    On a distorted map, walls of one room can lie in another.
    """
    again: Mask = binary_dilation(ground.grid.flown) & ~ground.passable
    cost = np.where(again, RETRACED_COST, ground.cost)
    return replace(ground, passable=ground.passable | again, cost=cost)


def with_kept_out(ground: CostGrid, keep_outs: Sequence[KeepOut]) -> CostGrid:
    """The cost grid with the places of teammates that have the right of way.

    A path leads round them if it can. Otherwise the drone waits there until they have left.
    """
    if not keep_outs:
        return ground
    kept_out = ground.kept_out.copy()
    for each in keep_outs:
        row, column = ground.grid.cell(each.ne_m)
        rows, columns = np.ogrid[: kept_out.shape[0], : kept_out.shape[1]]
        kept_out |= np.hypot(rows - row, columns - column) * CELL_M < each.radius_m
    cost = np.where(kept_out, np.maximum(ground.cost, WAIT_COST), ground.cost)
    return replace(ground, cost=cost, kept_out=kept_out)


def find_ways(ground: CostGrid) -> ShortestPaths:
    """Shortest paths from the drone's cell, with Dijkstra's algorithm."""
    row, column = ground.start
    rows, columns = ground.cost.shape
    metres, came_from = dijkstra(
        graph(ground.cost),
        directed=False,
        indices=row * columns + column,
        return_predecessors=True,
    )
    return ShortestPaths(ground, metres.reshape(rows, columns), came_from)


def graph(cost: Array) -> csr_array:
    """Sparse graph that links each cell with its eight neighbours, each pair once.

    The weight is the distance in m times the mean cost. Cells with infinite cost have no links.
    """
    rows, columns = cost.shape
    around = np.pad(cost, ((0, 1), (1, 1)), constant_values=np.inf)
    near = [
        cells * CELL_M * 0.5 * (cost + around[down:, right + 1 :][:rows, :columns])
        for down, right, cells in NEIGHBOURS
    ]
    length_m = np.stack(near, axis=-1).reshape(-1, len(NEIGHBOURS))
    linked = np.isfinite(length_m)
    step = np.array([down * columns + right for down, right, _ in NEIGHBOURS], dtype=np.int32)
    ends = np.arange(cost.size, dtype=np.int32)[:, None] + step
    begin = np.concatenate([[0], np.cumsum(linked.sum(axis=1))], dtype=np.int32)
    return csr_array((length_m[linked], ends[linked], begin), shape=(cost.size, cost.size))


def _straightened(cells: Sequence[tuple[int, int]], room_m: Array) -> list[tuple[int, int]]:
    """Removes every corner that can be cut without less clearance.

    `room_m` is each cell's clearance, m, and 0 where the drone does not fit.
    """
    kept = [cells[0]]
    last = 0
    while last < len(cells) - 1:
        ahead = len(cells) - 1
        while ahead > last + 1 and not _may_cut(cells[last : ahead + 1], room_m):
            ahead -= max(1, (ahead - last) // 8)
        last = max(ahead, last + 1)
        kept.append(cells[last])
    return kept


def _may_cut(cells: Sequence[tuple[int, int]], room_m: Array) -> bool:
    along = min(room_m[cell] for cell in cells[1:])
    return bool(least_along(cells[0], cells[-1], room_m) >= min(along, AMPLE_M))


def least_along(a: tuple[int, int], b: tuple[int, int], values: Array | Mask) -> float:
    """Minimum value of the cells on the line between two cells, without the first."""
    steps = 2 * max(abs(b[0] - a[0]), abs(b[1] - a[1])) + 1
    rows = np.linspace(a[0], b[0], steps).round().astype(int)
    columns = np.linspace(a[1], b[1], steps).round().astype(int)
    return float(values[rows[1:], columns[1:]].min()) if steps > 1 else math.inf

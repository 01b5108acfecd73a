"""Ways through known free space: where the drone fits, how far it is, and along what line.

The drone is a disc. It fits where everything within its radius and clearance is known, and free;
and where it has been before, though what was met beside has moved in on the map by a cell or two.
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

from companion.core.frames import Vector2
from companion.mapping.occupancy import CELL_M, Cells, Occupancy

START_NE_M: Vector2 = (0.0, 0.0)
TIGHT_CLEAR_M = 0.4
"""From the drone's centre to the sides of a doorway; what has less is an opening not entered."""
DEEP_M = 0.7
"""From where it has all of its clearance it goes so far into what is narrower: no doorway is
deeper, and in a corridor like that it would be blind to both sides for too long."""
FLOWN_CLEAR_M = 0.3
"""Likewise where it has come through: no door has been closed there."""
TIGHT_COST = 12.0
"""Where it is tight, a way counts as so much longer: the drone goes there only to pass."""
RETRACED_COST = 30.0
"""Likewise where something is drawn that was not there when the drone came through."""
NEIGHBOURS = ((0, 1, 1.0), (1, 0, 1.0), (1, 1, math.sqrt(2)), (1, -1, math.sqrt(2)))
CLOSE_COST = 4.0
"""A way along the edge of what is allowed counts as so much longer than one in the open."""
AMPLE_M = 0.9
"""More room than this is no reason for a detour."""
OPEN_M = 0.5
"""So far beyond its clearance the drone is in the open."""


@dataclass(frozen=True, slots=True)
class CostGrid:
    """Where the drone fits, and what it costs to be there."""

    grid: Occupancy
    """As much of the space as has been seen."""
    start: tuple[int, int]
    """The cell that it is in."""
    passable: Cells
    room_m: NDArray[np.float64]
    """To what is there, or is not known to be free."""
    cost: NDArray[np.float64]
    """What a metre through each cell counts as, infinite where the drone does not fit."""

    def fits(self, place_ne_m: Vector2) -> bool:
        """Whether the drone does, there."""
        cell = self.grid.cell(place_ne_m)
        return self.grid.has(cell) and bool(self.passable[cell])

    def fits_along(self, start_ne_m: Vector2, end_ne_m: Vector2) -> bool:
        """Whether it does on the straight line between two places."""
        steps = np.linspace(
            start_ne_m, end_ne_m, 2 + round(math.dist(start_ne_m, end_ne_m) / CELL_M)
        )
        return all(self.fits((north, east)) for north, east in steps.tolist())

    def clear_m(self, place_ne_m: Vector2) -> float:
        """Distance to anything that is there, or may be."""
        row, column = self.grid.cell(place_ne_m)
        return float(self.room_m[row, column])


@dataclass(frozen=True, slots=True)
class ShortestPaths:
    """All ways from where the drone is."""

    ground: CostGrid
    metres: NDArray[np.float64]
    """Cost of the way to each cell, infinite where there is none; in metres in the open."""
    came_from: NDArray[np.int32]

    def reaches(self, place_ne_m: Vector2) -> bool:
        cell = self.ground.grid.cell(place_ne_m)
        return self.ground.grid.has(cell) and bool(np.isfinite(self.metres[cell]))

    def to(self, place_ne_m: Vector2) -> tuple[Vector2, ...]:
        """Corner points of the way there, the place last; straight where it can be."""
        row, column = self.ground.grid.cell(place_ne_m)
        cells = [(row, column)]
        flat = row * self.metres.shape[1] + column
        while (before := int(self.came_from[flat])) >= 0:
            flat = before
            cells.append(divmod(flat, self.metres.shape[1]))
        cells.reverse()
        corners = _straightened(cells, np.where(self.ground.passable, self.ground.room_m, 0.0))
        return (*(self.ground.grid.place(cell) for cell in corners[1:-1]), place_ne_m)

    def length_m(self, way: tuple[Vector2, ...]) -> float:
        """Of a way from where the drone is, metres."""
        start = self.ground.grid.place(self.ground.start)
        return sum(math.dist(a, b) for a, b in pairwise((start, *way)))


def find_ground(grid: Occupancy, from_ne_m: Vector2, clear_m: float) -> CostGrid:
    """Cells where the drone fits; the one it is in always counts as such.

    `clear_m` is from the drone's centre to anything; doorways are passed with less.
    """
    grid = grid.seen_part(from_ne_m, clear_m + CELL_M)
    room = distance_transform_edt(grid.free) * CELL_M
    tight_m = min(clear_m, TIGHT_CLEAR_M)
    passable: Cells = room >= tight_m
    row, column = grid.cell(from_ne_m)
    reach = math.ceil(clear_m / CELL_M)
    around = np.s_[row - reach : row + reach + 1, column - reach : column + reach + 1]
    passable[around] |= room[around] >= min(room[row, column], tight_m)
    deep_m = _deep_m(grid, room >= clear_m)
    passable &= deep_m <= max(DEEP_M, deep_m[row, column])
    passable |= _flown_before(grid, passable)
    if not grid.allowed.all():  # beams do not show what is in the way there: no passing with less
        allowed_m = distance_transform_edt(grid.allowed) * CELL_M
        passable &= allowed_m >= clear_m
        passable[row, column] = True
        room = np.minimum(room, allowed_m)
    crowding = np.clip((clear_m + OPEN_M - room) / OPEN_M, 0, 1)
    cost = np.where(room < clear_m, TIGHT_COST, 1 + (CLOSE_COST - 1) * crowding)
    cost = np.where(passable, cost + (clear_m - room).clip(0) * TIGHT_COST, np.inf)
    return CostGrid(grid, (row, column), passable, room, cost)


def _deep_m(grid: Occupancy, roomy: Cells) -> NDArray[np.float64]:
    """To where it has all of its clearance, or took off."""
    from_here = roomy.copy()
    if grid.has(start := grid.cell(START_NE_M)):
        from_here[start] = True
    if not from_here.any():
        return np.zeros(roomy.shape)
    deep_m: NDArray[np.float64] = distance_transform_edt(~from_here) * CELL_M
    return deep_m


def _flown_before(grid: Occupancy, passable: Cells) -> Cells:
    """Where the drone has been that is not passable any more, and nothing is in its way."""
    flown: Cells = binary_dilation(grid.flown) & ~passable
    if not flown.any():
        return flown
    may: Cells = flown & (distance_transform_edt(~grid.occupied) * CELL_M >= FLOWN_CLEAR_M)
    return may


def retraced(ground: CostGrid) -> CostGrid:
    """Also where the drone has flown, whatever is drawn there.

    Where a map is bent, walls of one room stand in another.
    """
    again: Cells = binary_dilation(ground.grid.flown) & ~ground.passable
    cost = np.where(again, RETRACED_COST, ground.cost)
    return replace(ground, passable=ground.passable | again, cost=cost)


def find_ways(ground: CostGrid) -> ShortestPaths:
    """Dijkstra over the cells."""
    row, column = ground.start
    rows, columns = ground.cost.shape
    metres, came_from = dijkstra(
        graph(ground.cost),
        directed=False,
        indices=row * columns + column,
        return_predecessors=True,
    )
    return ShortestPaths(ground, metres.reshape(rows, columns), came_from)


def graph(cost: NDArray[np.float64]) -> csr_array:
    """Each cell with its eight neighbours, once, where both costs are finite: metres times cost."""
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


def _straightened(
    cells: Sequence[tuple[int, int]], room_m: NDArray[np.float64]
) -> list[tuple[int, int]]:
    """Leave out every corner that can be cut without coming nearer to anything.

    `room_m` is each cell's distance to what is there, 0 where the drone does not fit.
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


def _may_cut(cells: Sequence[tuple[int, int]], room_m: NDArray[np.float64]) -> bool:
    along = min(room_m[cell] for cell in cells[1:])
    return bool(least_along(cells[0], cells[-1], room_m) >= min(along, AMPLE_M))


def least_along(
    a: tuple[int, int], b: tuple[int, int], values: NDArray[np.float64] | Cells
) -> float:
    """The least value of the cells on the line between two, the first one left out."""
    steps = 2 * max(abs(b[0] - a[0]), abs(b[1] - a[1])) + 1
    rows = np.linspace(a[0], b[0], steps).round().astype(int)
    columns = np.linspace(a[1], b[1], steps).round().astype(int)
    return float(values[rows[1:], columns[1:]].min()) if steps > 1 else math.inf

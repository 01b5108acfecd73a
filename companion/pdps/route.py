"""Ways through known free space: where the drone fits, how far it is, and along what line.

The drone is a disc. It fits where everything within its radius and clearance is known, and free.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from companion.frames import Vector2
from companion.mapping.occupancy import CELL_M, Cells, Occupancy

TIGHT_CLEAR_M = 0.4
"""From the drone's centre to the sides of a doorway; what has less is an opening not entered."""
TIGHT_COST = 12.0
"""Where it is tight, a way counts as so much longer: the drone goes there only to pass."""
NEIGHBOURS = ((0, 1, 1.0), (1, 0, 1.0), (1, 1, math.sqrt(2)), (1, -1, math.sqrt(2)))
CLOSE_COST = 4.0
"""A way along the edge of what is allowed counts as so much longer than one in the open."""
AMPLE_M = 0.9
"""More room than this is no reason for a detour."""
OPEN_M = 0.5
"""So far beyond its clearance the drone is in the open."""


@dataclass(frozen=True, slots=True)
class Ways:
    """All ways from one place."""

    grid: Occupancy
    """As much of the space as has been seen."""
    start: tuple[int, int]
    passable: Cells
    room_m: NDArray[np.float64]
    """To what is there, or is not known to be free."""
    cost: NDArray[np.float64]
    """What a metre through each cell counts as, infinite where the drone does not fit."""
    metres: NDArray[np.float64]
    """Cost of the way to each cell, infinite where there is none; in metres in the open."""
    came_from: NDArray[np.int32]

    def reaches(self, place_ne_m: Vector2) -> bool:
        cell = self.grid.cell(place_ne_m)
        return self.grid.has(cell) and bool(np.isfinite(self.metres[cell]))

    def fits(self, place_ne_m: Vector2) -> bool:
        """Whether the drone does, there."""
        cell = self.grid.cell(place_ne_m)
        return self.grid.has(cell) and bool(self.passable[cell])

    def to(self, place_ne_m: Vector2) -> tuple[Vector2, ...]:
        """Corner points of the way there, the place last; straight where it can be."""
        row, column = self.grid.cell(place_ne_m)
        cells = [(row, column)]
        flat = row * self.metres.shape[1] + column
        while (before := int(self.came_from[flat])) >= 0:
            flat = before
            cells.append(divmod(flat, self.metres.shape[1]))
        cells.reverse()
        corners = _straightened(cells, np.where(self.passable, self.room_m, 0.0))
        return (*(self.grid.place(cell) for cell in corners[1:-1]), place_ne_m)

    def length_m(self, place_ne_m: Vector2) -> float:
        """Of the way there, metres."""
        start = self.grid.place(self.start)
        return sum(math.dist(a, b) for a, b in pairwise((start, *self.to(place_ne_m))))

    def clear_m(self, place_ne_m: Vector2) -> float:
        """Distance to anything that is there, or may be."""
        row, column = self.grid.cell(place_ne_m)
        return float(self.room_m[row, column])


def find_ways(grid: Occupancy, from_ne_m: Vector2, clear_m: float) -> Ways:
    """Dijkstra over the cells where the drone fits; the one it is in always counts as such.

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
    crowding = np.clip((clear_m + OPEN_M - room) / OPEN_M, 0, 1)
    cost = np.where(room < clear_m, TIGHT_COST, 1 + (CLOSE_COST - 1) * crowding)
    cost = np.where(passable, cost + (clear_m - room).clip(0) * TIGHT_COST, np.inf)
    start = row * passable.shape[1] + column
    metres, came_from = dijkstra(
        graph(cost), directed=False, indices=start, return_predecessors=True
    )
    return Ways(
        grid, (row, column), passable, room, cost, metres.reshape(passable.shape), came_from
    )


def graph(cost: NDArray[np.float64]) -> csr_array:
    """Each cell with its eight neighbours, once, where both costs are finite: metres times cost."""
    rows, columns = cost.shape
    number = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    starts, ends, lengths = [], [], []
    for down, right, cells in NEIGHBOURS:
        a = np.s_[: rows - down, max(-right, 0) : columns - max(right, 0)]
        b = np.s_[down:, max(right, 0) : columns - max(-right, 0)]
        length_m = cells * CELL_M * 0.5 * (cost[a] + cost[b])
        linked = np.isfinite(length_m)
        starts.append(number[a][linked])
        ends.append(number[b][linked])
        lengths.append(length_m[linked])
    entries = np.concatenate(lengths), (np.concatenate(starts), np.concatenate(ends))
    return coo_array(entries, shape=(number.size, number.size)).tocsr()


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

"""What is still unseen, and from where to look at it.

A frontier is known free space next to unknown space (Yamauchi 1997). It is worth a look if it is
wide enough to be more than the gap between two beams, and if the drone can come near enough.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, binary_dilation, label

from companion.frames import Vector2
from companion.mapping.occupancy import CELL_M, Cells, Occupancy
from companion.pdps.route import Ways, least_along

LEAST_FRONTIER_CELLS = 6
"""Six tenths of a metre: no drone fits through less."""
LOOK_FROM_M = (0.0, 2.5)
"""A frontier is looked at from within this."""
ROOM_TO_TURN_M = 0.9
"""A place to turn round in has so much room; where it has less, it counts as farther off."""
CROWDED_COST = 10.0
BEAM_GAP_CELLS = 2
GAIN, MOST_GAIN_M = 3.0, 9.0
"""How much farther a frontier may be that is one metre wider; and at most."""
PIECE_CELLS = 20
Indices = NDArray[np.int64]
PLUS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], dtype=bool)
SQUARE = np.ones((3, 3), dtype=bool)


@dataclass(frozen=True, slots=True)
class Look:
    """A place to look from, and what for."""

    from_ne_m: Vector2
    at_ne_m: Vector2
    """The middle of the frontier."""
    width_m: float


def frontiers(grid: Occupancy) -> Cells:
    """Free cells with an unknown neighbour that is not beside something occupied.

    Gaps between two beams that are narrower than the drone count as seen.
    """
    seen: Cells = binary_closing(np.pad(grid.free, BEAM_GAP_CELLS), SQUARE, BEAM_GAP_CELLS)
    seen = seen[BEAM_GAP_CELLS:-BEAM_GAP_CELLS, BEAM_GAP_CELLS:-BEAM_GAP_CELLS]
    unknown = ~(seen | grid.occupied)
    beside_wall = binary_dilation(grid.occupied, SQUARE)
    edge: Cells = np.logical_and(grid.free & ~beside_wall, binary_dilation(unknown, PLUS))
    return edge


def next_look(grid: Occupancy, ways: Ways, given_up: tuple[Vector2, ...] = ()) -> Look | None:
    """The best place to go to next; None when nothing unseen can be reached.

    Wide and near frontiers come first; those in `given_up` were looked at in vain.
    """
    looks = []
    for rows, columns in _pieces(frontiers(grid)):
        look = _look_at(grid, ways, rows, columns)
        if look is not None and not _is_near_any(look.at_ne_m, given_up):
            looks.append(look)
    return min(looks, key=lambda look: _cost_m(look, ways), default=None)


def _pieces(edge: Cells) -> Iterator[tuple[Indices, Indices]]:
    """Connected frontiers, long ones cut into pieces of about two metres."""
    numbers, _ = label(edge, SQUARE)
    rows, columns = np.nonzero(numbers)
    tiles = rows // PIECE_CELLS * edge.shape[1] + columns // PIECE_CELLS
    keys = numbers[rows, columns] * edge.size + tiles
    for key in np.unique(keys):
        mine = keys == key
        if mine.sum() >= LEAST_FRONTIER_CELLS:
            yield rows[mine], columns[mine]


def _look_at(grid: Occupancy, ways: Ways, rows: Indices, columns: Indices) -> Look | None:
    """From the cheapest reachable cell near the frontier's middle that sees it."""
    middle = int(np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2))
    target = int(rows[middle]), int(columns[middle])
    reach = round(LOOK_FROM_M[1] / CELL_M)
    low_row, low_column = max(target[0] - reach, 0), max(target[1] - reach, 0)
    window = ways.metres[low_row : target[0] + reach + 1, low_column : target[1] + reach + 1]
    candidates = np.argwhere(np.isfinite(window))
    if not len(candidates):
        return None
    candidates += (low_row, low_column)
    away = np.hypot(*(candidates - target).T) * CELL_M
    crowded = np.maximum(ROOM_TO_TURN_M - ways.to_occupied_m[tuple(candidates.T)], 0)
    cost = ways.metres[tuple(candidates.T)] + away + CROWDED_COST * crowded
    order = np.argsort(cost, kind="stable")
    for index in order[:200]:
        cell = int(candidates[index][0]), int(candidates[index][1])
        if away[index] <= LOOK_FROM_M[1] and least_along(cell, target, grid.free):
            return Look(grid.place(cell), grid.place(target), len(rows) * CELL_M)
    return None


def _cost_m(look: Look, ways: Ways) -> float:
    row, column = ways.grid.cell(look.from_ne_m)
    return float(ways.metres[row, column]) - min(GAIN * look.width_m, MOST_GAIN_M)


def _is_near_any(place: Vector2, others: tuple[Vector2, ...]) -> bool:
    return any(math.dist(place, other) < 0.4 for other in others)


def is_unseen(grid: Occupancy, place_ne_m: Vector2) -> bool:
    """There is still something unknown about a place."""
    row, column = grid.cell(place_ne_m)
    around = np.s_[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]
    return bool((~grid.free[around] & ~grid.occupied[around]).any())

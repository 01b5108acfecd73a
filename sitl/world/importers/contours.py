"""Outlines of the occupied cells of a grid, with few corners.

Points are (column, row) in cells: cell (row, column) of the grid reaches from (column, row) to
(column + 1, row + 1).
"""

import numpy as np
from numpy.typing import NDArray

from sitl.world.geometry.polylines import Points, is_loop, join, simplify

TOLERANCE_CELLS = 0.7
"""Lets a straight wall that cells have turned into steps be straight again, and a wall one cell
thick keep its two sides. With the half cell of a jog, an outline stays about a cell from the truth.
"""
SAME_WITHIN_CELLS = 0.5

Cells = NDArray[np.bool_]


def roughness(occupied: Cells) -> int:
    """How many edges of cells there are between occupied ones and others."""
    rows = np.count_nonzero(occupied[1:] != occupied[:-1])
    return int(rows + np.count_nonzero(occupied[:, 1:] != occupied[:, :-1]))


def outlines(occupied: Cells) -> list[Points]:
    """Polylines between occupied cells and others, as stepped as they are."""
    return _joined(occupied.astype(np.int8), 1)


def borders(inside: Cells, beyond: Cells) -> list[Points]:
    """Polylines where cells of one kind meet cells of another; what is neither ends them."""
    return _joined(inside.astype(np.int8) - beyond.astype(np.int8), 2)


def lengthened(line: Points, by_cells: float) -> Points:
    """A polyline with ends, at both of them; a loop as it is."""
    if is_loop(line):
        return line
    out = np.stack([line[0] - line[1], line[-1] - line[-2]])
    out *= by_cells / np.linalg.norm(out, axis=1, keepdims=True)
    return np.concatenate([line[:1] + out[0], line[1:-1], line[-1:] + out[1]])


def straightened(outline: Points) -> Points:
    """The same without the steps that cells make of a slanted wall."""
    return simplify(_without_jogs(outline), TOLERANCE_CELLS)


def _joined(kind: NDArray[np.int8], step: int) -> list[Points]:
    """Polylines along which the kind of the cells changes by this much, up or down."""
    level = _runs(kind, step)
    upright = _runs(kind.T, step)[..., ::-1]
    return join(np.concatenate([level, upright]).astype(float), SAME_WITHIN_CELLS)


def _runs(kind: NDArray[np.int8], step: int) -> NDArray[np.int64]:
    """The edges along the rows, joined to straight runs: (n, 2, 2).

    A run ends where its occupied side changes, so that at a corner where two cells touch
    diagonally four runs meet, as they should.
    """
    # padded first: np.diff's own prepend would make 64-bit numbers of all cells
    side = np.diff(np.pad(kind, ((1, 1), (0, 0))), axis=0)
    side[np.abs(side) != step] = 0
    change = np.diff(np.pad(side, ((0, 0), (1, 1))), axis=1)
    begins = (change != 0) & (np.pad(side, ((0, 0), (0, 1))) != 0)
    ends = (change != 0) & (np.pad(side, ((0, 0), (1, 0))) != 0)
    row, begin = np.nonzero(begins)
    _, end = np.nonzero(ends)
    return np.stack([np.column_stack([begin, row]), np.column_stack([end, row])], axis=1)


def _without_jogs(corners: Points) -> Points:
    """Each edge one cell long, between a turn to one side and a turn to the other, as a point.

    Along a slanted wall these are the steps, and their middles lie on the wall.
    """
    along = np.diff(corners, axis=0)
    before = np.roll(along, 1, axis=0)
    turn = before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0]
    if not is_loop(corners):
        turn[0] = 0
    opposite = turn * np.roll(turn, -1) < 0
    is_jog = opposite & (np.abs(along).sum(axis=1) == 1)
    stays = ~is_jog & ~np.roll(is_jog, 1)
    middles = corners[:-1] + along / 2
    both = np.stack([corners[:-1], middles], axis=1).reshape(-1, 2)
    points: Points = both[np.stack([stays, is_jog], axis=1).reshape(-1)]
    closing = points[:1] if is_loop(corners) else corners[-1:]
    return np.concatenate([points, closing])

"""Traces the outlines of a grid's occupied cells, with few corners.

Points are (column, row) in cells: cell (row, column) of the grid reaches from (column, row) to
(column + 1, row + 1).
"""

import numpy as np
from numpy.typing import NDArray

from companion.core.arrays import Array, Indices, Mask
from sitl.world.geometry.polylines import is_loop, join, simplify

TOLERANCE_CELLS = 0.7
"""Tolerance of straightening, cells. Stepped cells of a straight wall become straight again, and a
wall one cell thick keeps its two sides. With half a cell from a jog, an outline stays within about
a cell of the truth."""
SAME_WITHIN_CELLS = 0.5
"""Distance within which two ends of edges are the same point, cells. All ends are whole numbers."""


def roughness(occupied: Mask) -> int:
    """Number of edges between occupied and other cells."""
    rows = np.count_nonzero(occupied[1:] != occupied[:-1])
    return int(rows + np.count_nonzero(occupied[:, 1:] != occupied[:, :-1]))


def outlines(occupied: Mask) -> list[Array]:
    """Polylines between occupied and other cells, with all steps."""
    return _joined(occupied.astype(np.int8), 1)


def borders(inside: Mask, beyond: Mask) -> list[Array]:
    """Polylines between cells of two kinds; they end at cells of neither kind."""
    return _joined(inside.astype(np.int8) - beyond.astype(np.int8), 2)


def lengthened(line: Array, by_cells: float) -> Array:
    """An open polyline extended at both ends; a loop is unchanged."""
    if is_loop(line):
        return line
    out = np.stack([line[0] - line[1], line[-1] - line[-2]])
    out *= by_cells / np.linalg.norm(out, axis=1, keepdims=True)
    return np.concatenate([line[:1] + out[0], line[1:-1], line[-1:] + out[1]])


def straightened(outline: Array) -> Array:
    """The outline without the steps of a slanted wall."""
    return simplify(_without_jogs(outline), TOLERANCE_CELLS)


def _joined(kind: NDArray[np.int8], step: int) -> list[Array]:
    """Polylines along which the kind of the cells changes by `step`, up or down."""
    level = _runs(kind, step)
    upright = _runs(kind.T, step)[..., ::-1]
    return join(np.concatenate([level, upright]).astype(float), SAME_WITHIN_CELLS)


def _runs(kind: NDArray[np.int8], step: int) -> Indices:
    """Edges along the rows, joined to straight runs (n, 2, 2).

    A run ends where its occupied side changes. Four runs therefore meet where two cells touch
    diagonally.
    """
    # padded first: np.diff's own prepend would convert all cells to 64 bits
    side = np.diff(np.pad(kind, ((1, 1), (0, 0))), axis=0)
    side[np.abs(side) != step] = 0
    change = np.diff(np.pad(side, ((0, 0), (1, 1))), axis=1)
    begins = (change != 0) & (np.pad(side, ((0, 0), (0, 1))) != 0)
    ends = (change != 0) & (np.pad(side, ((0, 0), (1, 0))) != 0)
    row, begin = np.nonzero(begins)
    _, end = np.nonzero(ends)
    return np.stack([np.column_stack([begin, row]), np.column_stack([end, row])], axis=1)


def _without_jogs(corners: Array) -> Array:
    """Replace each edge of one cell between opposite turns by its middle.

    Along a slanted wall these edges are the steps, and their middles lie on the wall.
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
    points: Array = both[np.stack([stays, is_jog], axis=1).reshape(-1)]
    closing = points[:1] if is_loop(corners) else corners[-1:]
    return np.concatenate([points, closing])

"""Finds pieces of a map's walls that are not walls: marks outside the building, specks inside."""

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from companion.core.arrays import Mask
from sitl.world.importers import CEILING_M
from sitl.world.importers.space import TOUCHING, near, of_each

MARK_M = 3.0
"""Largest size of a mark, m: a letter, a number, an arrow. Chosen."""
STROKE_M, STROKE_CELLS = 0.25, 3
"""Largest width of a mark's strokes, m or cells. Chosen."""
SPECK_CELLS = 5
"""Pieces with fewer cells are chair legs or noise. Chosen."""
BESIDE_CELLS = 1.5
"""Largest distance between the centres of touching cells, also at a corner, cells."""


def marks_outside(kept: Mask, occupied: Mask, cell_m: float) -> Mask:
    """Small pieces of thin strokes that touch no cell of the kept air: labels, stray echoes.

    They are in the unknown or outside the building, where no drone can detect them.
    """
    if not kept.any():
        return np.zeros_like(occupied)
    piece, count = ndimage.label(occupied, TOUCHING)
    is_mark = np.ones(count + 1, dtype=bool)
    is_mark[piece[near(kept, BESIDE_CELLS) & occupied]] = False
    is_mark[piece[_wide(occupied, cell_m)]] = False
    for number, (rows, columns) in enumerate(ndimage.find_objects(piece), start=1):
        most = max(rows.stop - rows.start, columns.stop - columns.start)
        is_mark[number] &= most * cell_m <= MARK_M
    is_mark[0] = False
    return of_each(piece, is_mark)


def _wide(occupied: Mask, cell_m: float) -> Mask:
    """Cells in the middle of pieces that are wider than a stroke."""
    return ~near(~occupied, max(STROKE_M / cell_m, STROKE_CELLS) / 2 + 0.5)


def report_pieces(marks: Mask, kept: Mask, occupied: Mask, report: Callable[[str], None]) -> None:
    """Report the dropped marks and the kept specks."""
    _, left_out = ndimage.label(marks, TOUCHING)
    if left_out:
        report(f"left out {left_out} marks in the unknown or outside: labels, or stray echoes")
    piece, count = ndimage.label(occupied, TOUCHING)
    size = np.bincount(piece[occupied], minlength=count + 1)
    is_inside = np.zeros(count + 1, dtype=bool)
    is_inside[piece[near(kept, BESIDE_CELLS) & occupied]] = True
    specks = int(np.count_nonzero(is_inside & (size < SPECK_CELLS)))
    if specks:
        report(
            f"kept {specks} specks of fewer than {SPECK_CELLS} cells, legs of chairs or noise, "
            f"as pillars up to the ceiling at {CEILING_M:g} m"
        )

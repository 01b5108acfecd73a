"""Pieces of a map's walls that are none: marks outside the building, and specks inside."""

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from sitl.world.importers import CEILING_M
from sitl.world.importers.space import TOUCHING, near, of_each
from sitl.world.known import Cells

MARK_M = 3.0
"""A letter of a label, a number, an arrow is no larger."""
STROKE_M, STROKE_CELLS = 0.25, 3
"""Nor are its strokes wider than one of these."""
SPECK_CELLS = 5
"""Fewer, and it is a chair's leg, or noise."""
BESIDE_CELLS = 1.5
"""Cells that touch, also at a corner, are no farther apart from centre to centre."""


def marks_outside(kept: Cells, occupied: Cells, cell_m: float) -> Cells:
    """Small pieces of thin strokes that no cell of the kept air touches: labels, stray echoes.

    They are in the unknown or outside the building, where no drone can see them.
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


def _wide(occupied: Cells, cell_m: float) -> Cells:
    """The cells in the middle of what is wider than a stroke."""
    return ~near(~occupied, max(STROKE_M / cell_m, STROKE_CELLS) / 2 + 0.5)


def tell_of_pieces(marks: Cells, kept: Cells, occupied: Cells, tell: Callable[[str], None]) -> None:
    """How many marks were left out, and how many specks were not."""
    _, left_out = ndimage.label(marks, TOUCHING)
    if left_out:
        tell(f"left out {left_out} marks in the unknown or outside: labels, or stray echoes")
    piece, count = ndimage.label(occupied, TOUCHING)
    size = np.bincount(piece[occupied], minlength=count + 1)
    is_inside = np.zeros(count + 1, dtype=bool)
    is_inside[piece[near(kept, BESIDE_CELLS) & occupied]] = True
    specks = int(np.count_nonzero(is_inside & (size < SPECK_CELLS)))
    if specks:
        tell(
            f"kept {specks} specks of fewer than {SPECK_CELLS} cells, legs of chairs or noise, "
            f"as pillars up to the ceiling at {CEILING_M:g} m"
        )

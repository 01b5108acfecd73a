"""Writes OctoMap's binary octree: ENU, m, z = 0 on the floor at take-off.

Cells that beams passed through are free, at the height of the beam. Cells of walls are occupied
from floor to ceiling.
"""

from pathlib import Path

import numpy as np
import pyoctomap

from companion.export.cells import CELL_M
from companion.export.plan.survey import Survey
from companion.export.points import points_enu_m
from companion.export.rays import rays

SURELY_OCCUPIED = 7.0
"""Log odds of a wall cell. Chosen: exceeds any number of beams that graze the wall."""


def write_bt(survey: Survey, path: Path) -> None:
    """Write the octree with cells of `CELL_M`."""
    tree = pyoctomap.OcTree(CELL_M)
    for ray, point in zip(rays(survey.plan), points_enu_m(survey).astype(float), strict=False):
        eye = np.array([*ray[0], point[2]])
        tree.insertPointCloud(point[None, :], eye, lazy_eval=True)
    for place in _wall_points(survey):
        tree.updateNode(place, SURELY_OCCUPIED, lazy_eval=True)
    tree.updateInnerOccupancy()
    if not tree.writeBinary(str(path)):
        raise OSError(0, "OctoMap could not write it")


def _wall_points(survey: Survey) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Points (n, 3), ENU, m: at least one for each cell of each wall."""
    heights_m = np.arange(CELL_M / 2, survey.height_m, CELL_M)
    pieces = [np.empty((0, 3))]
    for wall in survey.plan.walls:
        steps = np.linspace(0, 1, max(2, int(wall.length_m / (CELL_M / 2))))[:, None]
        along = (1 - steps) * np.array(wall.start_ne_m) + steps * np.array(wall.end_ne_m)
        xy = np.repeat(along[:, ::-1], len(heights_m), axis=0)
        pieces.append(np.column_stack([xy, np.tile(heights_m, len(along))]))
    return np.concatenate(pieces)

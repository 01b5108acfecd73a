"""What of a map's cells is air, where a drone fits, and what it can only look into.

A robot's map ends where its beams ended: free cells border on unknown ones. Nobody knows what is
there; the simulated building is closed along that border, but for gaps too narrow to matter.
"""

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from sitl.world.geometry.model import BODY_RADIUS_M
from sitl.world.known import Cells, Numbers
from sitl.world.plan import NARROWEST_DOOR_M

GAP_M = 0.2
"""Unknown cells nowhere wider lie between a scanner's beams, or behind a chair's leg: nothing
stands there, though nobody may start there."""
AT_WALLS_M = 0.15
"""So near to a wall a gap is one in the wall, unless it leads nowhere."""
STRIP_M = 2 * BODY_RADIUS_M
"""Free cells between unknown ones, no wider than this, are where single beams went out; the
border runs across them."""
BESIDE_WALLS_M = 0.25
"""But not along walls, which say themselves where the free cells end."""
RAYS = 16
MIN_ENCLOSED = 12
"""Of so many directions a wall must be met before anything unknown; else a place is in a fan that
was seen through an opening, or outside."""
LATTICE_M = 0.4
MAX_LOOKED_FROM = 4000
MIN_SHARE = 0.5
"""Of the room in the largest region: a smaller one has no starts."""
TILE = 256
"""Distances are worked out for squares of so many cells a side: most squares of a large map hold
cells of one kind only, and those of all cells at once would take gigabytes."""
TOUCHING = np.ones((3, 3), dtype=bool)
"""Cells that touch at a corner belong together."""


@dataclass(frozen=True, slots=True, eq=False)
class Space:
    """The air of a map, and its regions: what is connected without openings narrower than doors."""

    air: Cells
    """Where nothing stands."""
    region: Numbers
    """Of each cell, 1, 2, ...; 0 where no drone fits."""
    order: list[int]
    """Regions with starts, the one with the most room first."""
    fits_m2: float
    """Where a drone fits,"""
    fan_m2: float
    """the part of it that is in a fan, or outside,"""
    apart_m2: float
    """and the part in regions too small for starts, which no way leads to from the largest."""

    @property
    def kept(self) -> Cells:
        """The air that hangs together with regions where a drone may start: all that it can see."""
        patch, count = ndimage.label(self.air)
        holds = np.zeros(count + 1, dtype=bool)
        holds[patch[self.rank() >= 0]] = True
        return of_each(patch, holds)

    def rank(self) -> NDArray[np.int32]:
        """Of each cell the place of its region in the order, 0 first; -1 where nobody starts."""
        of_region = np.full(int(self.region.max(initial=0)) + 1, -1, dtype=np.int32)
        of_region[self.order] = np.arange(len(self.order))
        return of_each(self.region, of_region)


def space_of(free: Cells, occupied: Cells, cell_m: float) -> Space:
    """What a map's free and occupied cells leave to fly in."""
    air = _air(free, occupied, cell_m)
    fits = ~near(~air, _narrow(cell_m))
    region, count = ndimage.label(fits)
    step = _lattice_step(fits, cell_m)
    at = np.argwhere(fits[::step, ::step]) * step
    is_room = enclosed(at, air, occupied)
    each_m2 = float(np.count_nonzero(fits)) * cell_m**2 / max(1, len(at))
    room = np.bincount(region[tuple(at[is_room].T)], minlength=count + 1)
    by_room = np.argsort(-room, kind="stable").tolist()
    order = [r for r in by_room if room[r] and room[r] >= MIN_SHARE * room[by_room[0]]]
    return Space(
        air,
        region,
        order,
        fits_m2=each_m2 * len(at),
        fan_m2=each_m2 * int(np.count_nonzero(~is_room)),
        apart_m2=each_m2 * int(room.sum() - room[order].sum()),
    )


def _narrow(cell_m: float) -> float:
    """Distance in cells that the drone keeps in the narrowest door; doors are cells wide."""
    return (NARROWEST_DOOR_M / 2 - cell_m) / cell_m


def near(cells: Cells, radius: float) -> Cells:
    """All that have one of these cells within a radius, in cells, from centre to centre."""
    if radius < 1:
        return cells
    found = np.zeros_like(cells)
    margin = math.ceil(radius)
    rows, columns = cells.shape
    for top, left in product(range(0, rows, TILE), range(0, columns, TILE)):
        low, west = max(0, top - margin), max(0, left - margin)
        tile = cells[low : top + TILE + margin, west : left + TILE + margin]
        here = found[top : top + TILE, left : left + TILE]
        if tile.all():
            here[:] = True
        elif tile.any():
            within = ndimage.distance_transform_edt(~tile) <= radius
            here[:] = within[top - low :, left - west :][: len(here), : here.shape[1]]
    return found


def of_each(label: Numbers, table: NDArray[Any]) -> NDArray[Any]:
    """What a table says of each cell's label; row by row, or the numbers would be copied whole."""
    found = np.empty(label.shape, dtype=table.dtype)
    for row, numbers in enumerate(label):
        found[row] = table[numbers]
    return found


def _air(free: Cells, occupied: Cells, cell_m: float) -> Cells:
    """Where nothing stands: free cells but for strips that only beams went through, and gaps."""
    open_ = free | _gaps(free, occupied, cell_m)
    wide = _opened(open_ | near(occupied, BESIDE_WALLS_M / cell_m), STRIP_M / cell_m / 2)
    return open_ & wide


def _gaps(free: Cells, occupied: Cells, cell_m: float) -> Cells:
    """The unknown cells that are taken for air."""
    unknown = ~(free | occupied)
    wide = _opened(unknown, GAP_M / cell_m / 2)
    patch, count = ndimage.label(unknown)
    leads_somewhere = np.zeros(count + 1, dtype=bool)
    leads_somewhere[patch[wide]] = True
    at_walls = near(occupied, AT_WALLS_M / cell_m)
    gaps: Cells = unknown & ~wide & ~(at_walls & of_each(patch, leads_somewhere))
    return gaps


def _opened(cells: Cells, radius: float) -> Cells:
    """Without what is no wider than twice this radius, in cells."""
    return cells & near(~near(~cells, radius), radius)


def _lattice_step(fits: Cells, cell_m: float) -> int:
    """Every so many cells one is looked from."""
    most = math.sqrt(np.count_nonzero(fits) / MAX_LOOKED_FROM)
    return max(1, round(LATTICE_M / cell_m), math.ceil(most))


def enclosed(at: Numbers, air: Cells, occupied: Cells) -> Cells:
    """(n,): whether from cells (n, 2) walls are met in nearly all directions.

    A wall counts as one cell thicker than it is: beams go between the cells of some.
    """
    bearing = np.arange(RAYS) * math.tau / RAYS + 0.01
    step = np.column_stack([np.cos(bearing), np.sin(bearing)])
    is_wall = ndimage.binary_dilation(occupied, TOUCHING)
    place = (at[:, None] + 0.5 + 0 * step).reshape(-1, 2)
    step = np.tile(step, (len(at), 1))
    meets = np.zeros(len(place), dtype=bool)
    going = np.arange(len(place))
    rows, columns = air.shape
    while len(going):
        place[going] += step[going]
        row, column = np.floor(place[going]).astype(np.int64).T
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        going, row, column = going[inside], row[inside], column[inside]
        wall = is_wall[row, column]
        meets[going[wall]] = True
        going = going[air[row, column] & ~wall]
    found: Cells = meets.reshape(-1, RAYS).sum(axis=1) >= MIN_ENCLOSED
    return found


def reached(passable: Cells, at: Numbers, cell_m: float) -> Cells:
    """What of it a drone can get to from a cell (row, column), and about there."""
    region, _ = ndimage.label(~near(~passable, _narrow(cell_m)))
    here = region[tuple(at)]
    if not here:
        return np.zeros_like(passable)
    about: Cells = passable & near(region == here, _narrow(cell_m))
    return about

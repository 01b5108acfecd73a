"""Classifies a map's cells: air, places where a drone fits, and areas only visible from them.

A robot's map ends where its beams ended: free cells border on unknown ones. The simulated building
is closed along that border, except at gaps too narrow to matter.
"""

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from companion.core.arrays import Indices, Mask
from sitl.world.geometry.model import BODY_RADIUS_M
from sitl.world.plan import NARROWEST_DOOR_M

GAP_M = 0.2
"""Widest gap of unknown cells that counts as air, m: between a scanner's beams, or behind a chair's
leg. A start is still not placed there. Chosen."""
AT_WALLS_M = 0.15
"""A gap this near to a wall is part of the wall unless it is a dead end, m. Chosen."""
STRIP_M = 2 * BODY_RADIUS_M
"""Strips of free cells between unknown ones, no wider than this, are traces of single beams, m. The
border runs across them."""
BESIDE_WALLS_M = 0.25
"""Strips this near to walls stay: there the wall itself limits the free cells, m. Chosen."""
RAYS = 16
"""Directions checked around a place."""
MIN_ENCLOSED = 12
"""Directions of `RAYS` that must hit a wall before the unknown. Otherwise the place is outside, or
in a fan that was seen through an opening. Chosen."""
LATTICE_M = 0.4
"""Spacing of the places that are checked for enclosure, m. Chosen."""
MAX_LOOKED_FROM = 4000
"""Largest number of such places. Chosen."""
MIN_SHARE = 0.5
"""Smallest room of a region with starts, as a share of the largest region's room. Chosen."""
TILE = 256
"""Side of the squares for which distances are computed, cells. Most squares of a large map have one
kind of cells only; all cells at once would take gigabytes."""
TOUCHING = np.ones((3, 3), dtype=bool)
"""Cells that touch at a corner are connected."""


@dataclass(frozen=True, slots=True, eq=False)
class Space:
    """The air of a map, and its regions: areas connected by openings at least as wide as a door."""

    air: Mask
    """Cells without obstacles."""
    region: Indices
    """Region of each cell, 1, 2, ...; 0 where no drone fits."""
    order: list[int]
    """Regions with starts, the largest first."""
    fits_m2: float
    """Area where a drone fits, m²."""
    fan_m2: float
    """Part of it in a fan or outside, m²."""
    apart_m2: float
    """Part of it in regions that are too small for starts and not connected to the largest, m²."""

    @property
    def kept(self) -> Mask:
        """The air connected to regions with starts: all that a drone can see."""
        patch, count = ndimage.label(self.air)
        holds = np.zeros(count + 1, dtype=bool)
        holds[patch[self.rank() >= 0]] = True
        return of_each(patch, holds)

    def rank(self) -> NDArray[np.int32]:
        """Rank of each cell's region, 0 first; -1 where a drone cannot start."""
        of_region = np.full(int(self.region.max(initial=0)) + 1, -1, dtype=np.int32)
        of_region[self.order] = np.arange(len(self.order))
        return of_each(self.region, of_region)


def space_of(free: Mask, occupied: Mask, cell_m: float) -> Space:
    """The space for flight in a map's free and occupied cells."""
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
    """Clearance in the narrowest door, cells, reduced by one because doors are whole cells wide."""
    return (NARROWEST_DOOR_M / 2 - cell_m) / cell_m


def near(cells: Mask, radius: float) -> Mask:
    """Cells with one of the given cells within a radius, in cells, between centres."""
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


def of_each(label: Indices, table: NDArray[Any]) -> NDArray[Any]:
    """The table's entry for each cell's label; by rows, to limit the memory."""
    found = np.empty(label.shape, dtype=table.dtype)
    for row, numbers in enumerate(label):
        found[row] = table[numbers]
    return found


def _air(free: Mask, occupied: Mask, cell_m: float) -> Mask:
    """Cells without obstacles: free cells without the traces of single beams, and gaps."""
    open_ = free | _gaps(free, occupied, cell_m)
    wide = _opened(open_ | near(occupied, BESIDE_WALLS_M / cell_m), STRIP_M / cell_m / 2)
    return open_ & wide


def _gaps(free: Mask, occupied: Mask, cell_m: float) -> Mask:
    """Unknown cells that count as air."""
    unknown = ~(free | occupied)
    wide = _opened(unknown, GAP_M / cell_m / 2)
    patch, count = ndimage.label(unknown)
    leads_somewhere = np.zeros(count + 1, dtype=bool)
    leads_somewhere[patch[wide]] = True
    at_walls = near(occupied, AT_WALLS_M / cell_m)
    gaps: Mask = unknown & ~wide & ~(at_walls & of_each(patch, leads_somewhere))
    return gaps


def _opened(cells: Mask, radius: float) -> Mask:
    """The cells without parts no wider than twice this radius, in cells."""
    return cells & near(~near(~cells, radius), radius)


def _lattice_step(fits: Mask, cell_m: float) -> int:
    """Spacing in cells of the places that are checked for enclosure."""
    most = math.sqrt(np.count_nonzero(fits) / MAX_LOOKED_FROM)
    return max(1, round(LATTICE_M / cell_m), math.ceil(most))


def enclosed(at: Indices, air: Mask, occupied: Mask) -> Mask:
    """True for each of the cells (n, 2) with walls in nearly all directions, (n,).

    A wall counts as one cell thicker, because beams can pass between the cells of thin ones.
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
    found: Mask = meets.reshape(-1, RAYS).sum(axis=1) >= MIN_ENCLOSED
    return found


def reached(passable: Mask, at: Indices, cell_m: float) -> Mask:
    """Cells that a drone reaches from a cell (row, column), and those next to them."""
    region, _ = ndimage.label(~near(~passable, _narrow(cell_m)))
    here = region[tuple(at)]
    if not here:
        return np.zeros_like(passable)
    about: Mask = passable & near(region == here, _narrow(cell_m))
    return about

"""Occupancy grid at flight height: cells are free, occupied or unknown.

Every reading frees the cells along its beam and fills the cell at its end. A beam without a return
only frees cells. Each cell holds the log-odds of occupancy (Moravec and Elfes 1985), so later or
more accurate readings override earlier ones, and a person who has left is removed. Free and unknown
cells are distinct.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, binary_dilation

from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2, to_nearest_m
from companion.mapping.rays import Ray, Rays

CELL_M = 0.1
"""Size of a cell, m. Chosen."""
CHUNK_CELLS = 64
"""The grid grows by this many cells. Chosen."""
HIT, MISS = 1.2, -0.5
"""Log-odds added by a hit, and by a beam that passes. Chosen."""
MAX_LOG_ODDS = 4.0
"""Limit of the log-odds. Chosen."""
OCCUPIED_ABOVE, FREE_BELOW = 0.6, -0.4
"""Log-odds above which a cell is occupied, and below which it is free. Chosen."""
EXACT_SIGMA_M, MIN_EXACT_SIGMA_M = 0.04, 0.12
"""A reading with at most the first sigma has full weight, m; above it the weight falls. A reading
with more than the second fills no cell, because its wall would be smeared. Chosen."""
WELL_SIGMA_M = 0.055
"""Largest sigma of a reading that maps a surface well, m. Chosen."""
MIN_FACING = 0.1
"""Least cosine between beam and a side of the cell to map that side. Chosen: a wall that is oblique
to the grid has two sides of its cells facing the beam."""
SIDES = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""North, east, south and west side of a cell, in rows and columns."""
GAP_CELLS = 1
"""A strip of space is known free with up to this many unknown cells across, between beams.
Chosen."""
STEP_CELLS = 0.5
"""Step along a beam between freed points, cells. Chosen."""
LOW_WITHIN_M = 0.5
"""A low ceiling is extended by this, m, because it was measured only along the flight path.
Chosen."""
FREE_TO_SIGMAS = 2.0
"""Cells are freed up to this many sigmas before the end of the beam. Chosen."""

LogOdds = NDArray[np.float32]
Bits = NDArray[np.uint8]


class _Layers(NamedTuple):
    """Data of all cells; arrays of one shape."""

    log_odds: LogOdds
    well_seen: Bits
    """One bit for each of the SIDES."""
    flown: Mask
    allowed: Mask
    met_s: Array
    """Time of the last hit in the cell, s; 0 without one, minus infinity in an earlier flight."""

    @classmethod
    def unknown(cls, shape: tuple[int, int]) -> Self:
        """No cell is measured, and all are allowed."""
        return cls(
            np.zeros(shape, dtype=np.float32),
            np.zeros(shape, dtype=np.uint8),
            np.zeros(shape, dtype=np.bool_),
            np.ones(shape, dtype=np.bool_),
            np.zeros(shape),
        )

    def each(self, change: Callable[[NDArray[Any]], NDArray[Any]]) -> Self:
        """Apply a function to all arrays."""
        return type(self)(*(change(layer) for layer in self))


class Occupancy:
    """A grid that grows with the measurements. Rows go north, columns east."""

    def __init__(self) -> None:
        half = CHUNK_CELLS // 2
        self._low = (-half, -half)
        self._layers = _Layers.unknown((CHUNK_CELLS, CHUNK_CELLS))
        self._is_all_allowed = True
        """True if cells outside the grid are allowed."""
        self.changes = 0
        """Number of times that cells have changed."""

    def _with(self, low: tuple[int, int], layers: _Layers) -> "Occupancy":
        other = Occupancy()
        other._low, other._layers = low, layers
        other._is_all_allowed = self._is_all_allowed
        return other

    def layer_above(
        self, low_ne_m: Sequence[Vector2], known: "Occupancy | None" = None
    ) -> "Occupancy":
        """A new grid for the layer above, with the cells `known` there from earlier flights.

        Cells that are free here are allowed, except at low ceilings.
        """
        is_measured = binary_closing(self.free, iterations=GAP_CELLS + 1) & ~self.occupied
        low = np.zeros_like(self.allowed)
        for cell in filter(self.has, map(self.cell, low_ne_m)):
            low[cell] = True
        is_low = binary_dilation(low, iterations=round(LOW_WITHIN_M / CELL_M))
        allowed = (is_measured | self.free) & self.allowed & ~is_low
        if known is None:
            above = self._with(self._low, _Layers.unknown(self.shape)._replace(allowed=allowed))
            above._is_all_allowed = False
            return above
        above = known.copy()
        rows, columns = self.shape
        for corner in ((0, 0), (rows - 1, columns - 1)):
            above._reach(self.place(corner))
        above._is_all_allowed = False
        row, column = above.cell(self.place((0, 0)))
        above.allowed[:] = False
        above.allowed[row : row + rows, column : column + columns] = allowed
        return above

    def of_earlier_flight(self) -> "Occupancy":
        """A copy for the next flight, whose clock begins anew."""
        met_s = np.where(self._layers.met_s != 0, -math.inf, 0.0)
        return self._with(self._low, self._layers._replace(met_s=met_s).each(np.copy))

    def copy(self) -> "Occupancy":
        """A copy."""
        return self._with(self._low, self._layers.each(np.copy))

    def with_obstacles(self, places_ne_m: Array) -> "Occupancy":
        """This grid, with the cells at some places (n, 2) occupied. The rest is not copied."""
        rows, columns = (self._indices(places_ne_m[:, axis], axis) for axis in (0, 1))
        inside = (rows >= 0) & (rows < self.shape[0]) & (columns >= 0) & (columns < self.shape[1])
        log_odds = self._layers.log_odds.copy()
        log_odds[rows[inside], columns[inside]] = MAX_LOG_ODDS
        return self._with(self._low, self._layers._replace(log_odds=log_odds))

    def within(self, radius_m: float) -> "Occupancy":
        """This grid, with no cell allowed beyond a distance of the origin; nothing else copied."""
        rows, columns = self.shape
        north_m = CELL_M * (np.arange(rows) + self._low[0] + 0.5)
        east_m = CELL_M * (np.arange(columns) + self._low[1] + 0.5)
        is_inside = north_m[:, None] ** 2 + east_m**2 <= radius_m**2
        return self._with(self._low, self._layers._replace(allowed=self.allowed & is_inside))

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All content by name, for `of_arrays`."""
        where = {"low": np.array(self._low), "is_all_allowed": np.array(self._is_all_allowed)}
        return where | self._layers._asdict()

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> "Occupancy":
        """The grid with this content."""
        grid = cls()
        row, column = arrays["low"].tolist()
        grid._low, grid._is_all_allowed = (row, column), bool(arrays["is_all_allowed"])
        grid._layers = _Layers(**{name: arrays[name] for name in _Layers._fields})
        return grid

    def window(self, places_ne_m: Sequence[Vector2], margin_m: float) -> "Occupancy":
        """A copy of the part around some positions."""
        cells = np.array([self.cell(place) for place in places_ne_m])
        margin = math.ceil(margin_m / CELL_M)
        top, left = np.maximum(cells.min(axis=0) - margin, 0).tolist()
        bottom, right = (cells.max(axis=0) + margin + 1).tolist()
        part = self._layers.each(lambda layer: layer[top:bottom, left:right].copy())
        return self._with((self._low[0] + top, self._low[1] + left), part)

    def seen_part(self, place_ne_m: Vector2, margin_m: float) -> "Occupancy":
        """A copy of the measured part, extended to contain a position."""
        is_measured = self._layers.log_odds != 0
        rows, columns = (
            np.flatnonzero(is_measured.any(axis=1)),
            np.flatnonzero(is_measured.any(axis=0)),
        )
        corners = [(rows[0], columns[0]), (rows[-1], columns[-1])] if len(rows) else []
        return self.window([place_ne_m, *(self.place(cell) for cell in corners)], margin_m)

    @property
    def shape(self) -> tuple[int, int]:
        rows, columns = self._layers.log_odds.shape
        return rows, columns

    @property
    def free(self) -> Mask:
        return self._layers.log_odds < FREE_BELOW

    @property
    def occupied(self) -> Mask:
        return self._layers.log_odds > OCCUPIED_ABOVE

    def well_seen(self, side: int) -> Mask:
        """Cells in which an accurate reading has hit this one of the SIDES."""
        is_measured: Mask = (self._layers.well_seen >> side & 1).astype(np.bool_)
        return is_measured

    @property
    def flown(self) -> Mask:
        """Cells that the drone's centre has crossed."""
        return self._layers.flown

    @property
    def allowed(self) -> Mask:
        """Cells without obstacles from other heights."""
        return self._layers.allowed

    def cell(self, place_ne_m: Vector2) -> tuple[int, int]:
        """Row and column; may be outside the grid."""
        return (
            math.floor(place_ne_m[0] / CELL_M) - self._low[0],
            math.floor(place_ne_m[1] / CELL_M) - self._low[1],
        )

    def has(self, cell: tuple[int, int]) -> bool:
        """True if the cell is inside the grid."""
        return 0 <= cell[0] < self.shape[0] and 0 <= cell[1] < self.shape[1]

    def place(self, cell: tuple[int, int]) -> Vector2:
        """Middle of a cell."""
        return (
            (cell[0] + self._low[0] + 0.5) * CELL_M,
            (cell[1] + self._low[1] + 0.5) * CELL_M,
        )

    def met_near(self, place_ne_m: Vector2, within_m: float) -> tuple[Array, Array]:
        """Occupied cells within about this distance: middles (n, 2) and last hits' times (n,)."""
        window = self._around(place_ne_m, within_m)
        cells = np.nonzero(self._layers.log_odds[window] > OCCUPIED_ABOVE)
        return self._middles(cells, window), self._layers.met_s[window][cells]

    def is_met_near(self, places_ne_m: Array, within_m: float) -> Mask:
        """(n,): True for places (n, 2) with the middle of an occupied cell within a distance."""
        reach = math.ceil(within_m / CELL_M)
        around = np.indices((2 * reach + 1,) * 2).reshape(2, -1) - reach
        rows, columns = (
            self._indices(places_ne_m[:, axis, None], axis) + around[axis] for axis in (0, 1)
        )
        off_m = [
            CELL_M * (cells + self._low[axis] + 0.5) - places_ne_m[:, axis, None]
            for axis, cells in enumerate((rows, columns))
        ]
        is_near = np.hypot(*off_m) <= within_m
        is_near &= (rows >= 0) & (rows < self.shape[0])
        is_near &= (columns >= 0) & (columns < self.shape[1])
        is_near[is_near] = self._layers.log_odds[rows[is_near], columns[is_near]] > OCCUPIED_ABOVE
        met: Mask = is_near.any(axis=1)
        return met

    def met_before(
        self, time_s: float, place_ne_m: Vector2, within_m: float, flown_m: float
    ) -> Array:
        """Middles (n, 2) of occupied cells within a distance, last hit before `time_s`.

        Cells within `flown_m` of the flight path are excluded.
        """
        window = self._around(place_ne_m, within_m)
        met_s = self._layers.met_s[window]
        is_before = (self._layers.log_odds[window] > OCCUPIED_ABOVE) & (met_s < time_s)
        before = self._middles(np.nonzero(is_before & (met_s != 0)), window)
        if not len(before):
            return before
        wider = self._around(place_ne_m, within_m + flown_m)
        flown = self._middles(np.nonzero(self._layers.flown[wider]), wider)
        unflown: Array = before[to_nearest_m(before, flown) > flown_m]
        return unflown

    def _around(self, place_ne_m: Vector2, within_m: float) -> tuple[slice, slice]:
        """Rows and columns within about this distance."""
        row, column = self.cell(place_ne_m)
        reach = math.ceil(within_m / CELL_M)
        top, left = max(row - reach, 0), max(column - reach, 0)
        bottom, right = max(row + reach + 1, 0), max(column + reach + 1, 0)
        return np.s_[top:bottom, left:right]

    def _middles(self, cells: Sequence[NDArray[Any]], window: tuple[slice, slice]) -> Array:
        """(n, 2): middles of cells, as rows and columns (n,) of a window."""
        if not len(cells[0]):
            return np.empty((0, 2))
        return CELL_M * np.column_stack(
            [
                each + (part.start + low) + 0.5
                for each, part, low in zip(cells, window, self._low, strict=True)
            ]
        )

    def nearest_m(self, place_ne_m: Vector2, within_m: float) -> float:
        """Distance to the nearest occupied cell, at most `within_m`."""
        near, _ = self.met_near(place_ne_m, within_m)
        if not len(near):
            return within_m
        off = near - self.place(self.cell(place_ne_m))
        return min(float(np.hypot(*off.T).min(initial=within_m)), within_m)

    def known_free_m(
        self, from_ne_m: Vector2, bearing_rad: float, half_width_m: float, most_m: float
    ) -> float:
        """Length of a strip of space that is known free; gaps between beams are tolerated."""
        along = np.arange(0.0, most_m, CELL_M)
        aside = np.arange(-half_width_m, half_width_m + 0.5 * CELL_M, CELL_M)
        cos_b, sin_b = math.cos(bearing_rad), math.sin(bearing_rad)
        rows = self._indices(from_ne_m[0] + along[:, None] * cos_b - aside * sin_b, 0)
        columns = self._indices(from_ne_m[1] + along[:, None] * sin_b + aside * cos_b, 1)
        inside = (rows >= 0) & (rows < self.shape[0]) & (columns >= 0) & (columns < self.shape[1])
        log_odds = np.zeros(inside.shape, dtype=np.float32)
        log_odds[inside] = self._layers.log_odds[rows[inside], columns[inside]]
        unknown = (log_odds >= FREE_BELOW).sum(axis=1) > GAP_CELLS
        blocked = (log_odds > OCCUPIED_ABOVE).any(axis=1) | unknown
        return float(along[blocked.argmax()]) if blocked.any() else most_m

    def add(self, ray: Ray) -> None:
        """Add one reading."""
        self.draw(Rays.of([ray]))

    def draw(self, rays: Rays) -> None:
        """Add many readings."""
        if not len(rays.end_m):
            return
        self.changes += 1
        unit = np.column_stack([np.cos(rays.bearing_rad), np.sin(rays.bearing_rad)])
        ends = rays.origin_ne_m + rays.end_m[:, None] * unit
        reached = np.concatenate([rays.origin_ne_m, ends])
        self._reach((float(reached[:, 0].min()), float(reached[:, 1].min())))
        self._reach((float(reached[:, 0].max()), float(reached[:, 1].max())))
        self._free(rays, unit)
        log_odds = self._layers.log_odds
        north_m, east_m = rays.origin_ne_m.T
        self.flown[self._indices(north_m, 0), self._indices(east_m, 1)] = True
        is_accurate = rays.is_hit & (rays.sigma_m <= MIN_EXACT_SIGMA_M)
        weight = HIT * np.minimum(1.0, EXACT_SIGMA_M / np.maximum(rays.sigma_m, 1e-3))
        rows, columns = self._indices(ends[:, 0], 0), self._indices(ends[:, 1], 1)
        is_well_measured = is_accurate & (rays.sigma_m <= WELL_SIGMA_M)
        for side, towards in enumerate(SIDES):
            is_facing = is_well_measured & (unit @ towards < -MIN_FACING)
            self._layers.well_seen[rows[is_facing], columns[is_facing]] |= np.uint8(1 << side)
        met = rows[is_accurate], columns[is_accurate]
        np.add.at(log_odds, met, weight[is_accurate])
        log_odds[met] = np.minimum(log_odds[met], MAX_LOG_ODDS)
        np.maximum.at(self._layers.met_s, met, rays.time_s[is_accurate])

    def _free(self, rays: Rays, unit: Array) -> None:
        """Free each cell that a ray crossed, once per ray."""
        before_m = np.where(rays.is_hit, FREE_TO_SIGMAS * rays.sigma_m + CELL_M, 0.0)
        free_to_m = np.maximum(rays.end_m - before_m, CELL_M)
        steps = np.ceil(free_to_m / (STEP_CELLS * CELL_M)).astype(np.int64)
        begin = np.cumsum(steps) - steps
        ray = np.repeat(np.arange(len(steps)), steps)
        cells_on = STEP_CELLS * (np.arange(len(ray)) - begin[ray])
        passed = np.floor(rays.origin_ne_m[ray] / CELL_M + cells_on[:, None] * unit[ray])
        rows, columns = (passed.astype(np.int64) - self._low).T
        cells = rows * self.shape[1] + columns
        is_new = np.ones(len(cells), dtype=bool)
        is_new[1:] = cells[1:] != cells[:-1]
        is_new[begin] = True
        flat = self._layers.log_odds.reshape(-1)
        np.add.at(flat, cells[is_new], np.float32(MISS))
        flat[cells] = np.maximum(flat[cells], -MAX_LOG_ODDS)

    def block(self, place_ne_m: Vector2, radius_m: float) -> None:
        """Mark a disc as occupied, independent of the readings."""
        self.changes += 1
        self._reach(place_ne_m)
        row, column = self.cell(place_ne_m)
        reach = math.ceil(radius_m / CELL_M)
        near = self._layers.log_odds[
            max(row - reach, 0) : row + reach + 1, max(column - reach, 0) : column + reach + 1
        ]
        near[:] = MAX_LOG_ODDS

    def _indices(self, metres: Array, axis: int) -> Indices:
        return np.floor(metres / CELL_M).astype(np.int64) - self._low[axis]

    def _reach(self, place_ne_m: Vector2) -> None:
        """Grow the grid so that a position is at least two cells inside."""
        for axis in (0, 1):
            index = self.cell(place_ne_m)[axis]
            before = CHUNK_CELLS * max(0, math.ceil((2 - index) / CHUNK_CELLS))
            beyond = index + 3 - self.shape[axis]
            after = CHUNK_CELLS * max(0, math.ceil(beyond / CHUNK_CELLS))
            if before or after:
                widths = [(0, 0), (0, 0)]
                widths[axis] = (before, after)
                allowed = np.pad(self.allowed, widths, constant_values=self._is_all_allowed)
                grown = self._layers.each(partial(np.pad, pad_width=widths))
                self._layers = grown._replace(allowed=allowed)
                low = list(self._low)
                low[axis] -= before
                self._low = (low[0], low[1])

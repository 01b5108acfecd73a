"""Tracks the free floor: where pieces may stand, and which ways they must not block.

It is a grid of places 10 cm apart, aligned with the world's north and east.
"""

import numpy as np
import shapely
from scipy import ndimage

from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2
from sitl.world.clutter.pieces import Piece
from sitl.world.clutter.standing import standing
from sitl.world.format import World, WorldError
from sitl.world.geometry.model import BODY_RADIUS_M
from sitl.world.geometry.nearest import NearestWall
from sitl.world.plan import NARROWEST_DOOR_M

Window = tuple[slice, slice]

GRID_M = 0.1
"""Distance between neighbouring places, m. Chosen."""
WAY_M = NARROWEST_DOOR_M / 2 - GRID_M / 2
"""Clearance of a way from its middle, m. In a doorway of 0.9 m, the narrowest one in the scores,
a grid place is at most half a step off the middle."""
FLIGHT_M = 0.85, 1.55
"""Height range of the drone's body at about 1.2 m, m: with its radius and drift. Chosen."""
STANDING_M = 0.05, 1.9
"""Height range in which furniture must not overlap other objects, m; lintels are above. Chosen."""
INSIDE_M = GRID_M
"""Clearance that proves, for two neighbours on the grid, that no wall is between them, m."""
START_CLEAR_M = 0.6 + BODY_RADIUS_M
"""Free radius around a start, m: the 0.6 m that `sitl world check` requires, from the hull."""
APART_M = 0.01
"""Smallest distance of two pieces, m. Chosen."""
POCKET_M2 = 0.25
"""Area reachable by the drone's centre that a piece may block, m²: a corner. Chosen."""
AROUND_M = 2.0
"""Radius around a piece in which blocked ways are searched first, m. Chosen; saves time only."""
MAX_SHUT = 1 / 3
"""Share of the area reachable from the first start that shut doors may block. Chosen."""


class FreeFloor:
    """Free floor of one world, without the pieces added so far."""

    def __init__(self, world: World) -> None:
        self._starts = [start.position for start in world.starts]
        self._origin, shape = _grid(world)
        axes = (self._origin[axis] + GRID_M * np.arange(shape[axis]) for axis in (0, 1))
        self._places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        self._points = np.asarray(shapely.points(self._places))
        away_m = self._away_m(world)
        self._inside = _joined(away_m > INSIDE_M, self._cells(self._starts))
        self._free: Mask = away_m > WAY_M
        self._taken: list[shapely.Geometry] = _solids(world)
        self._tree = shapely.STRtree(self._taken)
        self._pieces: list[shapely.Polygon] = []
        self._reached = self._get(self._starts)
        if not self._get(self._starts[:1]).any():
            raise WorldError(f"{world.name}: too little room around start 1 for clutter")
        self._at_first = int(self._get(self._starts[:1]).sum())

    @property
    def area_m2(self) -> float:
        """Area of the floor inside, m²."""
        return float(self._inside.sum()) * GRID_M**2

    @property
    def places(self) -> Array:
        """Places inside, (n, 2), m."""
        inside: Array = self._places[self._inside]
        return inside

    def is_inside(self, place: Vector2) -> bool:
        """The place is connected to a start at flight height."""
        cell = self._cell(place)
        return self._is_on_grid(cell) and bool(self._inside[cell])

    def is_open(self, near: Vector2, far: Vector2) -> bool:
        """The far place is inside, and nothing stands between the two places."""
        return self.is_inside(far) and self.is_clear(near, far)

    def is_clear(self, near: Vector2, far: Vector2) -> bool:
        """No original surface stands between two places."""
        line = shapely.LineString([near, far])
        return not len(self._tree.query(line, predicate="intersects"))

    def take(self, piece: Piece) -> bool:
        """Add a piece if its place is free and every place stays reachable; True if added."""
        if not self._has_room(piece):
            return False
        window, near = self._near(piece.footprint)
        pockets = self._pockets(window, near)
        if pockets is not None and pockets.sum() * GRID_M**2 > POCKET_M2:
            return False
        self._add(piece, window, near)
        if pockets is not None:
            self._reached &= ~pockets
        return True

    def shut(self, piece: Piece) -> bool:
        """Add a shut door, which may block the area behind it up to a limit; True if added."""
        if not self._has_room(piece):
            return False
        window, near = self._near(piece.footprint)
        before = self._free[window].copy()
        self._free[window] &= ~near
        left = self._get(self._starts[:1]).sum()
        self._free[window] = before
        if left < (1 - MAX_SHUT) * self._at_first:
            return False
        self._add(piece, window, near)
        self._reached = self._get(self._starts)
        return True

    def _away_m(self, world: World) -> Array:
        """Distance from each place to the nearest surface at flight height, m; infinite if far."""
        walls = np.array(standing(world, *FLIGHT_M), dtype=float).reshape(-1, 2, 2)
        if not len(walls):
            return np.full(self._places.shape[:2], np.inf)
        distance_m, _ = NearestWall(walls).query(self._places.reshape(-1, 2), max(INSIDE_M, WAY_M))
        away_m: Array = distance_m.reshape(self._places.shape[:2])
        return away_m

    def _has_room(self, piece: Piece) -> bool:
        footprint = piece.footprint
        middle = footprint.centroid.x, footprint.centroid.y
        if not self.is_open(middle, piece.anchor or middle):
            return False
        if any(footprint.distance(shapely.Point(at)) < START_CLEAR_M for at in self._starts):
            return False
        if len(self._tree.query(footprint, predicate="dwithin", distance=APART_M)):
            return False
        return not (self._pieces and shapely.dwithin(self._pieces, footprint, APART_M).any())

    def _near(self, footprint: shapely.Polygon) -> tuple[Window, Mask]:
        """Window around a piece, and its cells that are too near to the piece for a way."""
        window = self._window(footprint, AROUND_M)
        return window, np.asarray(shapely.dwithin(self._points[window], footprint, WAY_M))

    def _pockets(self, window: Window, near: Mask) -> Mask | None:
        """Cells that a piece would cut off; None if a check within the window finds none."""
        here = self._reached[window]
        before, _ = ndimage.label(here)
        after, parts = ndimage.label(here & ~near)
        if len(np.unique(before[after > 0])) == parts:
            return None
        free = self._reached.copy()
        free[window] &= ~near
        shut_off: Mask = free & ~_joined(free, self._roots())
        return shut_off

    def _roots(self) -> Indices:
        """Cell of the first start in each connected area."""
        cells = self._cells(self._starts)
        parts, _ = ndimage.label(self._reached)
        numbers = parts[tuple(cells.T)]
        _, first = np.unique(numbers, return_index=True)
        return cells[[n for n in first.tolist() if numbers[n]]]

    def _add(self, piece: Piece, window: Window, near: Mask) -> None:
        self._free[window] &= ~near
        self._reached[window] &= ~near
        self._pieces.append(piece.footprint)

    def _get(self, starts: list[Vector2]) -> Mask:
        """Cells that the drone can reach from these starts."""
        return _joined(self._free, self._cells(starts))

    def _cells(self, places: list[Vector2]) -> Indices:
        return np.array([self._cell(place) for place in places])

    def _cell(self, place: Vector2) -> tuple[int, int]:
        (north, east), (south, west) = place, self._origin
        return round((north - south) / GRID_M), round((east - west) / GRID_M)

    def _is_on_grid(self, cell: tuple[int, int]) -> bool:
        return all(0 <= cell[axis] < self._inside.shape[axis] for axis in (0, 1))

    def _window(self, footprint: shapely.Polygon, around_m: float) -> Window:
        south, west, north, east = footprint.bounds
        low = self._cell((south - around_m, west - around_m))
        high = self._cell((north + around_m, east + around_m))
        return (
            slice(max(low[0], 0), max(high[0], 0) + 1),
            slice(max(low[1], 0), max(high[1], 0) + 1),
        )


def _grid(world: World) -> tuple[Vector2, tuple[int, int]]:
    """Origin and size in cells of a grid that contains the world and its starts."""
    corners = [*world.bounds, *(point for line in world.closed_border for point in line)]
    corners += [start.position for start in world.starts]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    rows, columns = (np.ceil((high - low) / GRID_M).astype(int) + 1).tolist()
    return (float(low[0]), float(low[1])), (rows, columns)


def _joined(free: Mask, cells: Indices) -> Mask:
    """Free cells connected to any of the given cells."""
    parts, _ = ndimage.label(free)
    numbers = np.unique(parts[tuple(cells.T)])
    joined: Mask = np.isin(parts, numbers[numbers > 0])
    return joined


def _solids(world: World) -> list[shapely.Geometry]:
    """Objects that furniture must not overlap: surfaces, and boxes as solids."""
    low_m, high_m = STANDING_M
    lines = [shapely.LineString(segment) for segment in standing(world, low_m, high_m)]
    boxes = [
        shapely.box(*box.corner, box.corner[0] + box.size[0], box.corner[1] + box.size[1])
        for box in world.boxes
        if box.bottom_m < high_m and box.top_m > low_m
    ]
    return [*lines, *boxes]

"""Furnishes the rooms and keeps all of them accessible.

Furniture of any height stays clear of doorways. It leaves a way 1.1 m wide between all doorways of
a room and a start.
"""

import random
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from companion.core.arrays import Array
from companion.core.frames import Vector2
from sitl.world.format import Box, Segment
from sitl.world.generator.floor import Doorway, Rectangle

GRID_M = 0.1
"""Spacing of the grid on which ways are checked, m. Chosen."""
BEFORE_DOOR_M = 1.3
"""Free depth on both sides of every door, m. Chosen."""
ASIDE_OF_DOOR_M = 0.2
"""Free width beyond the door on either side, m. Chosen."""
AT_DOOR_M = 0.7
"""Distance from a wall's centre line to the place before its door, m. Chosen."""
WAY_M = 1.1
"""Width of a free way, m. Chosen."""
START_CLEARANCE_M = 0.85
"""Clearance around a start, m. Chosen."""
ROUNDING_M = 1e-6
"""Tolerance for rounding in the comparison of clearances, m. Chosen."""

FURNISHED = (0.0, 0.2, 0.4)
"""Pieces tried per m²; drawn for every building. Chosen."""
CORNERED = (0.0, 0.0, 0.5)
"""Share of rooms with a corner cut off; drawn for every building. Chosen."""
CORNER_M = 0.8
"""Smallest side of a cut corner, m. Chosen."""
CORNER_SHARE = 0.6
"""Largest side of a cut corner as a share of the room's side. Chosen."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A kind of furniture; m, heights above the floor."""

    widths: tuple[float, float]
    depths: tuple[float, float]
    bottom_m: float
    top_m: float
    by_wall: bool = True
    weight: float = 1.0
    """Relative frequency."""


PIECES = (
    Piece((1.2, 2.0), (0.7, 0.9), 0.70, 0.75),  # a desk
    Piece((1.2, 2.0), (0.8, 1.0), 0.70, 0.75, by_wall=False),  # a table
    Piece((0.8, 2.0), (0.4, 0.6), 0.0, 2.0),  # a cupboard
    Piece((0.8, 1.6), (0.25, 0.35), 1.4, 2.0),  # a shelf on the wall
    Piece((0.8, 1.8), (0.4, 0.5), 0.0, 0.8),  # a sideboard
    Piece((1.6, 2.2), (0.8, 1.0), 0.0, 0.8),  # a sofa
    Piece((0.9, 1.8), (2.0, 2.0), 0.0, 0.5),  # a bed
    Piece((0.3, 0.5), (0.3, 0.5), 0.0, np.inf, by_wall=False, weight=0.3),  # a pillar
)
"""Kinds of furniture with their sizes. Chosen."""


class Space:
    """The inside of a room, and the objects in it.

    Each object counts as a rectangle from floor to ceiling, a slanted wall as its corner.
    """

    def __init__(self, room: Rectangle, doorways: Sequence[Doorway], thickness_m: float) -> None:
        self.room = room
        self.inside = room.grown(-thickness_m / 2, -thickness_m / 2)
        self.boxes: list[Box] = []
        self.slanted: list[Segment] = []
        self._taken = [_kept_free(doorway, thickness_m) for doorway in doorways]
        norths, easts = (
            room.low[axis] + GRID_M * np.arange(round(room.length_m(axis) / GRID_M) + 1)
            for axis in (0, 1)
        )
        self._grid = norths[:, None], easts[None, :]
        self._clearance_m = self._to_walls_m()
        self._doors = [
            place
            for doorway in doorways
            for place in _before_door(doorway)
            if self.inside.holds(Rectangle(place, place))
        ]

    def take(self, place: Rectangle) -> bool:
        """Add an object if its place is free and the ways stay open; True if added."""
        if not self.inside.holds(place) or any(place.overlaps(other) for other in self._taken):
            return False
        clearance_m = np.minimum(self._clearance_m, self._distance_m(place))
        if not self._is_passable(clearance_m):
            return False
        self._clearance_m = clearance_m
        self._taken.append(place)
        return True

    def standing_room(self) -> list[Vector2]:
        """Places for a start, (north, east), m."""
        cells = np.argwhere(self._clearance_m >= START_CLEARANCE_M)
        return [
            (
                round(self.room.low[0] + GRID_M * row, 1),
                round(self.room.low[1] + GRID_M * column, 1),
            )
            for row, column in cells.tolist()
        ]

    def _is_passable(self, clearance_m: Array) -> bool:
        """One free area contains all doors and all places for a start, at least one."""
        parts, _ = ndimage.label(clearance_m >= WAY_M / 2 - ROUNDING_M)
        at_doors = {int(parts[self._cell(door)]) for door in self._doors}
        to_start = set(parts[clearance_m >= START_CLEARANCE_M].tolist())
        return bool(to_start) and len(at_doors | to_start) == 1 and 0 not in at_doors

    def _cell(self, place: Vector2) -> tuple[int, int]:
        north, east = place
        return round((north - self.room.low[0]) / GRID_M), round((east - self.room.low[1]) / GRID_M)

    def _to_walls_m(self) -> Array:
        """Distance of the grid's places to the room's walls, m; negative within them."""
        (south, west), (north, east) = self.inside
        norths, easts = self._grid
        to_north_m = np.minimum(norths - south, north - norths)
        to_east_m = np.minimum(easts - west, east - easts)
        return np.asarray(np.minimum(to_north_m, to_east_m))

    def _distance_m(self, place: Rectangle) -> Array:
        """Distance of the grid's places to a rectangle, m; 0 within it."""
        north_m, east_m = (
            np.maximum(np.maximum(place.low[axis] - along, along - place.high[axis]), 0.0)
            for axis, along in enumerate(self._grid)
        )
        return np.asarray(np.sqrt(north_m**2 + east_m**2))


def furnish(spaces: Sequence[Space], height_m: float, rng: random.Random) -> None:
    """Cut corners off some rooms, and furnish all of them."""
    cornered, furnished = rng.choice(CORNERED), rng.choice(FURNISHED)
    for space in spaces:
        if rng.random() < cornered:
            _cut_corner(space, height_m, rng)
        for _ in range(round(furnished * space.inside.area_m2)):
            [piece] = rng.choices(PIECES, [piece.weight for piece in PIECES])
            _put(piece, space, height_m, rng)


def _cut_corner(space: Space, height_m: float, rng: random.Random) -> None:
    """Add a slanted wall across a corner, or a shaft in it, which makes the room an L."""
    far = rng.random() < 0.5, rng.random() < 0.5
    size = tuple(
        _between(rng, CORNER_M, max(CORNER_M, CORNER_SHARE * space.inside.length_m(axis)), 0.1)
        for axis in (0, 1)
    )
    is_slanted = rng.random() < 0.5
    corner = _in_corner(space.inside, (size[0], size[1]), far)
    if not space.take(corner):
        return
    if is_slanted:
        space.slanted.append(_across_corner(space.room, (size[0], size[1]), far))
    else:
        space.boxes.append(_box(corner, 0.0, height_m))


def _across_corner(room: Rectangle, size: Vector2, far: tuple[bool, bool]) -> Segment:
    """The slanted wall between the walls' centre lines."""
    (north, east), (to_north, to_east) = (
        tuple((room.high if far[axis] else room.low)[axis] for axis in (0, 1)),
        tuple(-size[axis] if far[axis] else size[axis] for axis in (0, 1)),
    )
    return (round(north + to_north, 3), east), (north, round(east + to_east, 3))


def _in_corner(inside: Rectangle, size: Vector2, far: tuple[bool, bool]) -> Rectangle:
    """A rectangle that touches two walls."""
    low = [inside.high[axis] - size[axis] if far[axis] else inside.low[axis] for axis in (0, 1)]
    return _rectangle((low[0], low[1]), size)


def _put(piece: Piece, space: Space, height_m: float, rng: random.Random) -> None:
    """Try one random place and orientation for a piece."""
    width_m, depth_m = (_between(rng, *sizes, 0.05) for sizes in (piece.widths, piece.depths))
    axis = rng.randrange(2)
    size = (depth_m, width_m) if axis == 0 else (width_m, depth_m)
    slack = [space.inside.length_m(side) - size[side] for side in (0, 1)]
    if min(slack) < 0:
        return
    along = [_between(rng, 0.0, slack[side], GRID_M) for side in (0, 1)]
    if piece.by_wall:
        along[axis] = rng.choice((0.0, slack[axis]))
    low = space.inside.low
    place = _rectangle((low[0] + along[0], low[1] + along[1]), size)
    if space.take(place):
        space.boxes.append(_box(place, piece.bottom_m, min(piece.top_m, height_m)))


def _rectangle(low: Vector2, size: Vector2) -> Rectangle:
    north, east = round(low[0], 3), round(low[1], 3)
    return Rectangle((north, east), (round(north + size[0], 3), round(east + size[1], 3)))


def _box(place: Rectangle, bottom_m: float, top_m: float) -> Box:
    size = place.length_m(0), place.length_m(1)
    return Box(corner=place.low, size=size, bottom_m=bottom_m, top_m=top_m)


def _between(rng: random.Random, least_m: float, most_m: float, step_m: float) -> float:
    """A random length in whole steps from the smallest one."""
    return round(least_m + step_m * rng.randint(0, int((most_m - least_m) / step_m + 1e-6)), 3)


def _kept_free(doorway: Doorway, thickness_m: float) -> Rectangle:
    """The area to keep free on both sides of a door."""
    here = Rectangle(doorway.centre, doorway.centre)
    through_m = BEFORE_DOOR_M + thickness_m / 2
    aside_m = doorway.width_m / 2 + ASIDE_OF_DOOR_M
    if doorway.across == 0:
        return here.grown(through_m, aside_m)
    return here.grown(aside_m, through_m)


def _before_door(doorway: Doorway) -> tuple[Vector2, Vector2]:
    """The places before and behind a door."""
    north, east = doorway.centre
    if doorway.across == 0:
        return (round(north - AT_DOOR_M, 1), east), (round(north + AT_DOOR_M, 1), east)
    return (north, round(east - AT_DOOR_M, 1)), (north, round(east + AT_DOOR_M, 1))

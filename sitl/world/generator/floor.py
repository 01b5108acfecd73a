"""Generates a rectangular floor: rooms, the walls between them, and doorways.

A rectangle is split until its rooms are small enough, optionally first along both sides of a
corridor. A spanning tree of doorways connects all rooms; further doorways make loops. Rectangles
and walls are centre lines, in m on a grid of 10 cm.
"""

import random
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

from companion.core.frames import Vector2
from sitl.world.format import Segment

SIDES_M, LARGE_SIDES_M = (8, 16), (18, 24)
"""Ranges of the floor's sides, m: about what can be mapped in a flight of ten minutes, and large
buildings of 320 to 580 m² for surveys and teams."""
MIN_ROOM_M = 3.2
"""Smallest room side between centre lines, m: 3 m between thick walls."""
LARGE_ROOMS_M2 = (20, 60)
"""Range of the area above which rooms are split, m²; drawn for every building. Chosen."""
LONGEST_ROOM = 2.2
"""Largest ratio of a room's length to its width. Chosen."""
CORRIDOR_SHARE = 0.5
"""Probability of a corridor, if there is room for one. Chosen."""
CORRIDORS_M = (2.0, 2.2, 2.4, 2.6)
"""Widths of corridors between centre lines, m. Chosen."""
DOOR_WIDTHS_M = (1.0, 1.2, 1.4)
"""Widths of doorways, m. Chosen."""
DOOR_HEIGHTS_M = (2.0, 2.05, 2.1)
"""Heights of doorways, m. Chosen."""
BESIDE_DOOR_M = 0.3
"""Smallest wall on either side of a door, to the centre line of the next wall, m. Chosen."""
LOOP_SHARE = 0.25
"""Probability of a door between neighbours that are already connected. Chosen."""


class Rectangle(NamedTuple):
    """Sides along north and east; corners are (north, east)."""

    low: Vector2
    high: Vector2

    def length_m(self, axis: int) -> float:
        """Length along north (0) or east (1), m."""
        return round(self.high[axis] - self.low[axis], 3)

    @property
    def area_m2(self) -> float:
        return self.length_m(0) * self.length_m(1)

    def grown(self, north_m: float, east_m: float) -> "Rectangle":
        """Extended on every side; shrunk if negative."""
        return Rectangle(
            (round(self.low[0] - north_m, 3), round(self.low[1] - east_m, 3)),
            (round(self.high[0] + north_m, 3), round(self.high[1] + east_m, 3)),
        )

    def overlaps(self, other: "Rectangle") -> bool:
        """The rectangles share area, not only edges."""
        return all(
            self.low[axis] < other.high[axis] and other.low[axis] < self.high[axis]
            for axis in (0, 1)
        )

    def holds(self, other: "Rectangle") -> bool:
        return all(
            self.low[axis] <= other.low[axis] and other.high[axis] <= self.high[axis]
            for axis in (0, 1)
        )


@dataclass(frozen=True, slots=True)
class Doorway:
    """A door between two rooms."""

    wall: int
    """Number of its wall in the floor."""
    across: int
    """Axis of the passage: north (0) or east (1)."""
    centre: Vector2
    width_m: float
    height_m: float


@dataclass(frozen=True, slots=True)
class Floor:
    """A building's plan; `walls` are the inner walls."""

    outline: Rectangle
    rooms: list[Rectangle]
    walls: list[Segment]
    doorways: list[Doorway]


def random_floor(rng: random.Random, *, is_large: bool = False) -> Floor:
    """A floor with at least two rooms, all connected by doorways."""
    sides_m = LARGE_SIDES_M if is_large else SIDES_M
    outline = Rectangle((0.0, 0.0), (_decimetres(rng, *sides_m), _decimetres(rng, *sides_m)))
    large_m2 = rng.randint(*LARGE_ROOMS_M2)
    across = 0 if outline.length_m(0) <= outline.length_m(1) else 1
    width_m = rng.choice(CORRIDORS_M)
    slack_m = outline.length_m(across) - 2 * MIN_ROOM_M - width_m
    if slack_m >= 0 and rng.random() < CORRIDOR_SHARE:
        at_m = _decimetres(rng, MIN_ROOM_M, MIN_ROOM_M + slack_m)
        below, rest, wall = _cut(outline, across, at_m)
        corridor, above, other_wall = _cut(rest, across, round(at_m + width_m, 1))
        rooms, walls = [corridor], [wall, other_wall]
        for part in (below, above):
            _split(part, large_m2, rng, rooms, walls)
    else:
        rooms, walls = [], []
        _split(outline, large_m2, rng, rooms, walls)
    return Floor(outline, rooms, walls, _doorways(rooms, walls, rng))


def _split(
    room: Rectangle,
    large_m2: float,
    rng: random.Random,
    rooms: list[Rectangle],
    walls: list[Segment],
) -> None:
    """Split a room across its longer side while it is large or long; append to the lists."""
    axis = 0 if room.length_m(0) >= room.length_m(1) else 1
    length_m, width_m = room.length_m(axis), room.length_m(1 - axis)
    is_large = room.area_m2 > large_m2 or length_m > LONGEST_ROOM * width_m
    if not is_large or length_m < 2 * MIN_ROOM_M:
        rooms.append(room)
        return
    least_m = max(MIN_ROOM_M, 0.3 * length_m)
    at_m = room.low[axis] + _decimetres(rng, least_m, length_m - least_m)
    first, second, wall = _cut(room, axis, round(at_m, 1))
    walls.append(wall)
    _split(first, large_m2, rng, rooms, walls)
    _split(second, large_m2, rng, rooms, walls)


def _cut(room: Rectangle, axis: int, at_m: float) -> tuple[Rectangle, Rectangle, Segment]:
    """Two rooms and the wall between them."""
    if axis == 0:
        start, end = (at_m, room.low[1]), (at_m, room.high[1])
    else:
        start, end = (room.low[0], at_m), (room.high[0], at_m)
    return Rectangle(room.low, end), Rectangle(start, room.high), (start, end)


def _doorways(rooms: list[Rectangle], walls: list[Segment], rng: random.Random) -> list[Doorway]:
    """A spanning tree of doorways and some loops. A corridor, the first room, opens to all."""
    pairs = list(combinations(range(len(rooms)), 2))
    rng.shuffle(pairs)
    pairs.sort(key=lambda pair: pair[0] != 0)
    group = list(range(len(rooms)))
    doorways = []
    for a, b in pairs:
        shared = _shared_wall(rooms[a], rooms[b])
        if shared is None or (group[a] == group[b] and rng.random() >= LOOP_SHARE):
            continue
        group = [group[a] if number == group[b] else number for number in group]
        doorways.append(_doorway(*shared, walls, rng))
    return doorways


def _shared_wall(a: Rectangle, b: Rectangle) -> tuple[int, Vector2, float] | None:
    """The shared wall of two rooms: the axis across it, its begin, and its length, m.

    None if they share no wall that is long enough for a door.
    """
    for axis in (0, 1):
        along = 1 - axis
        from_m = max(a.low[along], b.low[along])
        length_m = round(min(a.high[along], b.high[along]) - from_m, 3)
        if length_m < DOOR_WIDTHS_M[0] + 2 * BESIDE_DOOR_M:
            continue
        for lower, upper in ((a, b), (b, a)):
            if lower.high[axis] == upper.low[axis]:
                at_m = lower.high[axis]
                return axis, ((at_m, from_m) if axis == 0 else (from_m, at_m)), length_m
    return None


def _doorway(
    across: int, begin: Vector2, length_m: float, walls: list[Segment], rng: random.Random
) -> Doorway:
    widths = [width_m for width_m in DOOR_WIDTHS_M if width_m + 2 * BESIDE_DOOR_M <= length_m]
    width_m = rng.choice(widths)
    beside_m = BESIDE_DOOR_M + width_m / 2
    along_m = _decimetres(rng, beside_m, length_m - beside_m)
    north, east = begin
    centre = (north, round(east + along_m, 1)) if across == 0 else (round(north + along_m, 1), east)
    wall = next(n for n, (start, end) in enumerate(walls) if _is_between(start, centre, end))
    return Doorway(wall, across, centre, width_m, rng.choice(DOOR_HEIGHTS_M))


def _is_between(start: Vector2, point: Vector2, end: Vector2) -> bool:
    return all(start[axis] <= point[axis] <= end[axis] for axis in (0, 1))


def _decimetres(rng: random.Random, least_m: float, most_m: float) -> float:
    """A length on the grid of 10 cm."""
    return rng.randint(round(10 * least_m), round(10 * most_m)) / 10

"""Tells the building from its furniture, and which walls were seen from both sides.

    walls of the map ─► joined at their ends ─┬─ with a long wall: building ─► solid walls,
                                              └─ without: furniture            faces, bare pieces

A mapped wall is a surface. Two parallel surfaces that were seen from opposite sides are one solid
wall, whose thickness is measured. Of a surface that was seen from one side the thickness is not
known.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from companion.core.arrays import Array, Mask
from companion.core.frames import Vector2
from companion.core.messages import FloorPlan, WallSegment
from companion.core.values import value
from companion.export.rays import rays

LONGEST_FURNITURE_M = 2.5
"""Surfaces joined with a longer one belong to the building, m. Chosen: longer than a sofa."""
TOUCHING_M = 0.3
"""Surfaces are joined if an end of one is this near to the other, m. Chosen: the ends of mapped
walls err by some centimetres, and a body passes through no gap of this width."""
THINNEST_M, THICKEST_M = 0.03, 0.5
"""Thickness of a solid wall, m. Chosen: below, the two surfaces may be one; above, it is a
shaft."""
SAME_DIRECTION = math.sin(math.radians(10))
"""Sine of the largest angle between the two surfaces of a solid wall. Chosen."""
SHORTEST_M = 0.3
"""Shortest piece of solid wall, or of a bare face, m. Chosen."""
ON_WALL_M = 0.2
"""A beam that ends this near to a surface has met it, m. Chosen: four sigmas of a range."""
SURELY = 0.6
"""A surface was seen from one side if its beams differ by this share between the sides. Chosen:
through a thin wall beams of both rooms seem to end on either surface."""


@value
class Solid:
    """A piece of wall that was seen from both sides."""

    ring_ne_m: tuple[Vector2, ...]
    """Its four corners: two along one surface, two back along the other."""
    thickness_m: float
    sigma_m: float
    """The greater sigma of its surfaces."""


@value
class Face:
    """A piece of wall that was seen from one side."""

    wall: WallSegment
    start_ne_m: Vector2
    end_ne_m: Vector2
    behind_ne: Vector2
    """Unit vector into the wall."""


@value
class Bare:
    """A piece of wall of which it is not clear from where it was seen."""

    wall: WallSegment
    start_ne_m: Vector2
    end_ne_m: Vector2


@value
class Building:
    """The map's walls by what they are."""

    walls: tuple[WallSegment, ...]
    furniture: tuple[WallSegment, ...]
    """Surfaces that stand free of the building."""
    solids: tuple[Solid, ...]
    faces: tuple[Face, ...]
    bare: tuple[Bare, ...]
    second_faces: frozenset[WallSegment]
    """The shorter surface of each solid wall."""


def building(plan: FloorPlan) -> Building:
    """Divide the walls of a map."""
    walls, furniture = _divided(plan.walls)
    lines = [_Line(wall) for wall in walls]
    beams = rays(plan)[:, :, ::-1]
    sides = [line.side_of_beams(beams) for line in lines]
    covered: list[list[Vector2]] = [[] for _ in walls]
    solids, second = [], set()
    near = _pairs(lines, lambda line, ends: line.are_near(ends))
    for i, j in np.argwhere(np.triu(near, 1)).tolist():
        overlap = lines[i].beside(lines[j], sides[i], sides[j])
        if overlap is None:
            continue
        solids.append(lines[i].solid(lines[j], overlap))
        covered[i].append(overlap)
        covered[j].append(lines[j].extent_m([lines[i].at_m(along_m) for along_m in overlap]))
        second.add(min(walls[i], walls[j], key=lambda wall: wall.length_m))
    faces, bare = [], []
    for line, side, pieces in zip(lines, sides, covered, strict=True):
        for piece in _uncovered(line.length_m, pieces):
            if abs(side) > SURELY:
                faces.append(line.face(piece, side))
            else:
                bare.append(line.bare(piece))
    return Building(walls, furniture, tuple(solids), tuple(faces), tuple(bare), frozenset(second))


def _divided(
    walls: Sequence[WallSegment],
) -> tuple[tuple[WallSegment, ...], tuple[WallSegment, ...]]:
    """The walls of the building, and furniture. Without a long wall all belong to the building."""
    lines = [_Line(wall) for wall in walls]
    is_building = [line.length_m > LONGEST_FURNITURE_M for line in lines]
    if not any(is_building):
        return tuple(walls), ()
    touched = _pairs(lines, lambda line, ends: line.are_touching(ends))
    joined = touched | touched.T
    ahead = [number for number, found in enumerate(is_building) if found]
    while ahead:
        for other in np.flatnonzero(joined[ahead.pop()]).tolist():
            if not is_building[other]:
                is_building[other] = True
                ahead.append(other)
    both = list(zip(walls, is_building, strict=True))
    return (
        tuple(wall for wall, found in both if found),
        tuple(wall for wall, found in both if not found),
    )


def _uncovered(length_m: float, pieces: Sequence[Vector2]) -> list[Vector2]:
    """Pieces of 0 to `length_m` that are in none of the given pieces."""
    left, from_m = [], 0.0
    for start_m, end_m in (*sorted(pieces), (length_m, length_m)):
        if start_m - from_m > SHORTEST_M:
            left.append((from_m, start_m))
        from_m = max(from_m, end_m)
    return left


def _pairs(lines: Sequence["_Line"], are: Callable[["_Line", Array], Mask]) -> Mask:
    """(w, w): what holds between each wall and the ends (w, 2, 2) of all walls."""
    if not lines:
        return np.zeros((0, 0), dtype=bool)
    ends_ne_m = np.array([line.ends_ne_m for line in lines])
    return np.array([are(line, ends_ne_m) for line in lines])


class _Line:
    """A wall's own coordinates: along it from its start, and to the right of it, m."""

    def __init__(self, wall: WallSegment) -> None:
        self._wall = wall
        self.ends_ne_m = wall.start_ne_m, wall.end_ne_m
        self._start: Array = np.array(wall.start_ne_m)
        self._end: Array = np.array(wall.end_ne_m)
        self.length_m = wall.length_m
        self._along: Array = (self._end - self._start) / max(self.length_m, 1e-9)
        self._right: Array = np.array((-self._along[1], self._along[0]))

    def at_m(self, along_m: float, right_m: float = 0.0) -> Vector2:
        """A place, north and east, m."""
        north_m, east_m = self._start + along_m * self._along + right_m * self._right
        return float(north_m), float(east_m)

    def _of(self, places_ne_m: Array) -> tuple[Array, Array]:
        """Along and to the right of the wall of places (..., 2), m, each (...)."""
        off_m = places_ne_m - self._start
        return off_m @ self._along, off_m @ self._right

    def extent_m(self, places_ne_m: Sequence[Vector2]) -> Vector2:
        """First and last place along the wall, m."""
        along_m, _ = self._of(np.array(places_ne_m))
        return float(along_m.min()), float(along_m.max())

    def side_of_beams(self, beams_ne_m: Array) -> float:
        """From which side beams (n, 2, 2) met the wall: -1 left to 1 right; 0 if none did."""
        along_m, right_m = self._of(beams_ne_m[:, 1])
        is_on_it = (np.abs(right_m) < ON_WALL_M) & (along_m > 0) & (along_m < self.length_m)
        _, from_right_m = self._of(beams_ne_m[is_on_it, 0])
        is_off = from_right_m[np.abs(from_right_m) > ON_WALL_M]
        return float(np.sign(is_off).mean()) if len(is_off) else 0.0

    def are_touching(self, ends_ne_m: Array) -> Mask:
        """(w,): True for walls with an end, of (w, 2, 2), near this one."""
        along_m, right_m = self._of(ends_ne_m)
        past_m = np.maximum(np.maximum(-along_m, along_m - self.length_m), 0.0)
        return np.asarray((np.hypot(past_m, right_m) < TOUCHING_M).any(axis=1))

    def are_near(self, ends_ne_m: Array) -> Mask:
        """(w,): True for walls with ends (w, 2, 2) that may be the other surface of this one."""
        _, right_m = self._of(ends_ne_m)
        near: Mask = np.abs(right_m.mean(axis=1)) < THICKEST_M
        return near

    def beside(self, other: "_Line", side: float, its_side: float) -> Vector2 | None:
        """Where along this wall the other is its second surface, m; None if it is not.

        `side`, `its_side`: from which side each was seen, left or right of itself.
        """
        along_m, right_m = self._of(np.array((other._start, other._end)))
        middle_m = float(right_m.mean())
        is_parallel = abs(right_m[1] - right_m[0]) < SAME_DIRECTION * other.length_m
        if not (is_parallel and THINNEST_M < abs(middle_m) < THICKEST_M):
            return None
        its_side *= math.copysign(1.0, float(self._right @ other._right) * middle_m)
        if side * math.copysign(1.0, middle_m) > SURELY or its_side < -SURELY:
            return None  # a beam was between them
        overlap = max(0.0, float(along_m.min())), min(self.length_m, float(along_m.max()))
        return overlap if overlap[1] - overlap[0] > SHORTEST_M else None

    def solid(self, other: "_Line", overlap_m: Vector2) -> Solid:
        """The wall between both surfaces."""
        along_m, right_m = self._of(np.array((other._start, other._end)))
        order = np.argsort(along_m)
        there_m = np.interp(overlap_m, along_m[order], right_m[order]).tolist()
        ring = [self.at_m(each_m) for each_m in overlap_m]
        ring += [
            self.at_m(*both) for both in zip(reversed(overlap_m), reversed(there_m), strict=True)
        ]
        sigma_m = max(self._wall.sigma_m, other._wall.sigma_m)
        return Solid(tuple(ring), abs(sum(there_m) / 2), sigma_m)

    def face(self, piece_m: Vector2, side: float) -> Face:
        """A piece that was seen from a side."""
        north, east = (-self._right if side > 0 else self._right).tolist()
        return Face(self._wall, self.at_m(piece_m[0]), self.at_m(piece_m[1]), (north, east))

    def bare(self, piece_m: Vector2) -> Bare:
        """A piece of which the side is not known."""
        return Bare(self._wall, self.at_m(piece_m[0]), self.at_m(piece_m[1]))

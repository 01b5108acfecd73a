"""Derives rooms with their areas, and openings, from the walls of the map.

    walls ─► cuts across narrow gaps ─► faces between walls and cuts ─► rooms
                                                    └─ cuts crossed by beams or path ─► openings

Mapped walls rarely close a room, because of doors, undetected corners and cupboards. Each wall is
therefore extended beyond its ends by a cut. The cut reaches another wall within a doorway's width,
or a wall in line with it if no beam crossed the gap. Walls and cuts bound faces. A face is a room
if beams or the path entered it and it is wide enough to stand in. A smaller face belongs to the
room beside it or lies inside a wall.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, MultiLineString, MultiPolygon, Polygon

from companion.core.arrays import Array
from companion.core.frames import Vector2, ned_to_frd
from companion.core.messages import FloorPlan, WallSegment
from companion.export.plan.jambs import Jambs
from companion.export.plan.turned import turned
from companion.export.rays import rays

WIDEST_DOOR_M = 1.5
"""Longest cut towards another wall, m. Chosen."""
NARROWEST_DOOR_M = 0.5
"""Shortest cut that counts as an opening, m. Chosen."""
WIDEST_HIDDEN_M = 4.0
"""Widest gap between walls in line that furniture hides, m. Chosen: beams cross an open gap."""
IN_LINE_M, SAME_DIRECTION = 0.15, math.sin(math.radians(20))
"""Largest lateral offset, m, and sine of the largest angle between two walls in line. Chosen."""
TOUCHING_M = 1e-9
"""Distance below which a point lies on the end of a wall, m. Chosen."""
GRID_M = 1e-4
"""Points closer than this are merged, m. Chosen."""
STANDING_WIDTH_M = 0.6
"""Diameter of the circle that fits into a room, m. Chosen."""
MIN_ROOM_M2 = 1.0
"""Smallest area of a room, m². Chosen."""
THICKEST_WALL_M = 0.6
"""Two openings whose middles are closer than this are the two sides of one doorway, m. Chosen."""
LOOKS = 3
"""Smallest number of beams and path legs that cross an opening. Chosen."""
UNKNOWN_HEIGHT_M = 2.5
"""Height of walls if the up beam never detected a ceiling, m. Chosen."""

Lines = NDArray[np.object_]
"""Shapely LineStrings, (n,)."""


@dataclass(frozen=True, slots=True)
class Opening:
    """A gap in a wall that beams or the path crossed, local NED."""

    start_ne_m: Vector2
    end_ne_m: Vector2
    sigma_m: float = 0.0
    """Sigma of its width; 0 if it is not known."""

    @property
    def width_m(self) -> float:
        return math.dist(self.start_ne_m, self.end_ne_m)

    def turned(self, up_rad: float) -> "Opening":
        """The same in a frame whose x axis has this heading, rad."""
        start, end = (ned_to_frd(*each, up_rad) for each in (self.start_ne_m, self.end_ne_m))
        return Opening(start, end, self.sigma_m)


@dataclass(frozen=True, slots=True)
class Room:
    """A closed outline, local NED, with holes for obstacles such as pillars."""

    name: str
    outline_ne_m: tuple[Vector2, ...]
    """Corners in order, (north, east), m; the first is not repeated."""
    holes_ne_m: tuple[tuple[Vector2, ...], ...]
    area_m2: float

    @property
    def polygon(self) -> Polygon:
        """The room as a polygon: x east, y north, m."""
        return Polygon(_xy(self.outline_ne_m), [_xy(hole) for hole in self.holes_ne_m])

    def turned(self, up_rad: float) -> "Room":
        """The same in a frame whose x axis has this heading, rad."""

        def ring(corners: Sequence[Vector2]) -> tuple[Vector2, ...]:
            return tuple(ned_to_frd(*corner, up_rad) for corner in corners)

        holes = tuple(map(ring, self.holes_ne_m))
        return replace(self, outline_ne_m=ring(self.outline_ne_m), holes_ne_m=holes)

    def label_ne_m(self, furniture: Sequence[WallSegment]) -> Vector2:
        """Position of the room's name, (north, east), m.

        It is the centre of the largest circle that fits between the walls and the furniture.
        """
        lines = MultiLineString([_line(each.start_ne_m, each.end_ne_m) for each in furniture])
        free = self.polygon.difference(lines.buffer(GRID_M))
        assert isinstance(free, Polygon | MultiPolygon)  # what is left of a polygon
        point = shapely.maximum_inscribed_circle(free, tolerance=0.05).coords[0]
        return point[1], point[0]


@dataclass(frozen=True, slots=True)
class Survey:
    """The map with its rooms and openings."""

    plan: FloorPlan
    rooms: tuple[Room, ...]
    """Sorted by area, the largest first."""
    openings: tuple[Opening, ...]

    @property
    def height_m(self) -> float:
        """Height of walls and ceiling above the floor at take-off, m."""
        return UNKNOWN_HEIGHT_M if self.plan.ceiling_m is None else self.plan.ceiling_m

    def turned(self, up_rad: float) -> "Survey":
        """The same in a frame whose x axis has this heading, rad."""
        return Survey(
            turned(self.plan, up_rad),
            tuple(room.turned(up_rad) for room in self.rooms),
            tuple(opening.turned(up_rad) for opening in self.openings),
        )


def survey(plan: FloorPlan) -> Survey:
    """Find the rooms and openings of a map."""
    looks = _looks(plan)
    cuts = _cuts(plan.walls, looks)
    faces = _faces(plan.walls, cuts)
    rooms = _rooms(faces, cuts, looks)
    openings = map(Jambs(plan).measured, _openings(cuts, rooms, looks))
    return Survey(plan, _named(rooms), tuple(openings))


def _line(start: Vector2, end: Vector2) -> LineString:
    return LineString(_xy([start, end]))


def _xy(points_ne_m: Sequence[Vector2]) -> list[Vector2]:
    return [(east, north) for north, east in points_ne_m]


def _looks(plan: FloorPlan) -> Lines:
    """Beams and legs of the paths, as shapely lines."""
    legs = [_xy([one.ne_m, other.ne_m]) for path in plan.paths for one, other in pairwise(path)]
    beams_and_legs = np.concatenate([rays(plan), np.array(legs).reshape(-1, 2, 2)])
    return np.array(shapely.linestrings(beams_and_legs), ndmin=1)


def _cuts(walls: Sequence[WallSegment], looks: Lines) -> list[LineString]:
    """Cuts from both ends of each wall to the nearest target ahead, if there is one."""
    lines = [_line(wall.start_ne_m, wall.end_ne_m) for wall in walls]
    cuts = []
    for number, line in enumerate(lines):
        others = lines[:number] + lines[number + 1 :]
        (x, y), (far_x, far_y) = line.coords
        for end, behind in (((x, y), (far_x, far_y)), ((far_x, far_y), (x, y))):
            target = _continued(np.array(end), np.array(behind), others, looks)
            if target is not None:
                cuts.append(LineString([end, (target[0], target[1])]))
    return cuts


def _continued(
    end: Array, behind: Array, others: Sequence[LineString], looks: Lines
) -> Array | None:
    """Target point ahead of a wall's end, (east, north), m, or None.

    The first rule with a result applies; it returns the nearest point.

    1. A wall across, or the end of a wall in line, within a doorway's width.
    2. The end of a wall in line, farther away, if the gap is not open.
    3. The corner where two extended walls meet.
    """
    ahead = _ahead(end, behind)
    in_line = [point for other in others for point in _in_line(end, behind, other)]
    found = [point for point in in_line if math.dist(point, end) < WIDEST_DOOR_M]
    for other in others:
        found += _crossing(ahead, other)
    if not found:
        found = [point for point in in_line if not _is_open(LineString([end, point]), looks)]
    if not found:
        for other in others:
            first, last = np.array(other.coords)
            found += _crossing(ahead, _ahead(first, last)) + _crossing(ahead, _ahead(last, first))
    return min(found, key=lambda point: float(np.linalg.norm(point - end)), default=None)


def _in_line(end: Array, behind: Array, other: LineString) -> list[Array]:
    """Ends ahead of another wall that is in line with this one."""
    along = (end - behind) / np.linalg.norm(end - behind)
    across = np.array([-along[1], along[0]])
    ends = np.array(other.coords)
    if abs((ends[1] - ends[0]) @ across) >= SAME_DIRECTION * other.length:
        return []
    forward, aside = (ends - end) @ along, np.abs((ends - end) @ across)
    return list(ends[(forward > TOUCHING_M) & (forward < WIDEST_HIDDEN_M) & (aside < IN_LINE_M)])


def _ahead(end: Array, behind: Array) -> LineString:
    along = (end - behind) / np.linalg.norm(end - behind)
    return LineString([end, end + WIDEST_DOOR_M * along])


def _crossing(ahead: LineString, other: LineString) -> list[Array]:
    """Intersection as a list of one point, (east, north), m; empty if none or at the start."""
    point = ahead.intersection(other)
    if not isinstance(point, shapely.Point) or point.is_empty:
        return []
    place = np.array([point.x, point.y])
    return [place] if math.dist(place, ahead.coords[0]) > TOUCHING_M else []


def _faces(walls: Sequence[WallSegment], cuts: Sequence[LineString]) -> list[Polygon]:
    lines = [_line(wall.start_ne_m, wall.end_ne_m) for wall in walls]
    noded = shapely.unary_union([*lines, *cuts], grid_size=GRID_M)
    faces = shapely.polygonize([noded]).geoms
    return [face for face in faces if isinstance(face, Polygon)]


def _rooms(faces: Sequence[Polygon], cuts: Sequence[LineString], looks: Lines) -> list[Polygon]:
    seen = [face for face in faces if shapely.intersects(looks, face.buffer(-GRID_M)).any()]
    rooms = [face for face in seen if _can_stand_in(face)]
    doorsteps = MultiLineString(list(cuts)).buffer(GRID_M)
    for corner in (face for face in seen if not _can_stand_in(face)):
        beside = [
            number
            for number, room in enumerate(rooms)
            if _longest_m(room.intersection(corner).intersection(doorsteps)) > IN_LINE_M
        ]
        if len(beside) == 1:
            joined = shapely.union(rooms[beside[0]], corner, grid_size=GRID_M)
            assert isinstance(joined, Polygon)  # the two polygons share a side
            rooms[beside[0]] = joined
    return sorted(rooms, key=lambda room: -room.area)


def _longest_m(sides: shapely.Geometry) -> float:
    """Length of the longest continuous piece, m.

    Two short pieces, such as the ends of a wall's two faces, do not add up to an opening.
    """
    merged = shapely.line_merge(sides)
    return float(shapely.length(shapely.get_parts(merged)).max(initial=0.0))


def _can_stand_in(face: Polygon) -> bool:
    return face.area > MIN_ROOM_M2 and not face.buffer(-STANDING_WIDTH_M / 2).is_empty


def _named(rooms: Sequence[Polygon]) -> tuple[Room, ...]:
    return tuple(
        Room(
            f"room {number}",
            _corners(room.exterior),
            tuple(_corners(hole) for hole in room.interiors),
            room.area,
        )
        for number, room in enumerate(rooms, start=1)
    )


def _corners(ring: shapely.LinearRing) -> tuple[Vector2, ...]:
    """Corners, (north, east), m; points on a straight line are omitted."""
    straightened = ring.simplify(GRID_M)
    return tuple((y, x) for x, y in straightened.coords[:-1])


def _openings(
    cuts: Sequence[LineString], rooms: Sequence[Polygon], looks: Lines
) -> tuple[Opening, ...]:
    """Cuts on a room's outline that beams or the path crossed; one for each doorway."""
    doors: list[LineString] = []
    for cut in sorted(cuts, key=lambda cut: cut.length):
        is_other_side = any(
            cut.centroid.distance(door.centroid) < THICKEST_WALL_M for door in doors
        )
        if not is_other_side and _is_door(cut, rooms, looks):
            doors.append(cut)
    return tuple(
        Opening((door.coords[0][1], door.coords[0][0]), (door.coords[1][1], door.coords[1][0]))
        for door in doors
    )


def _is_door(cut: LineString, rooms: Sequence[Polygon], looks: Lines) -> bool:
    """Test whether a cut is wide enough, lies on a room's outline, and is open."""
    strip = cut.buffer(GRID_M)
    return (
        cut.length >= NARROWEST_DOOR_M
        and any(room.boundary.intersection(strip).length > cut.length / 2 for room in rooms)
        and _is_open(cut, looks)
    )


def _is_open(cut: LineString, looks: Lines) -> bool:
    return int(np.count_nonzero(shapely.crosses(looks, cut))) >= LOOKS

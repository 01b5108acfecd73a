"""What a surveyor reads out of the map: rooms with their areas, and openings.

    walls ─► cuts across narrow gaps ─► faces between walls and cuts ─► rooms
                                                    └─ cuts looked or flown through ─► openings

Walls seldom close a room: there are doors, corners that no beam met, and cupboards in the way. So
each wall is continued beyond its ends until it meets another, if that is no farther than a doorway
is wide, or to one in line with it, if what is between them is hidden. Between walls and these cuts
lie faces; a face that the drone has seen into, and that is wide enough to stand in, is a room. The
smaller ones belong to the room beside them, or lie inside walls.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, MultiLineString, Polygon

from companion.core.frames import Vector2
from companion.core.messages import FloorPlan, WallSegment
from companion.export.rays import rays

WIDEST_DOOR_M = 1.5
NARROWEST_DOOR_M = 0.5
WIDEST_HIDDEN_M = 4.0
"""Of a wall behind furniture: a gap as wide that is open has beams that went through."""
IN_LINE_M, SAME_DIRECTION = 0.15, math.sin(math.radians(20))
"""How far aside of a wall's continuation the end of a wall of the same direction may be, to be what
it leads to, and how much the two may be turned."""
TOUCHING_M = 1e-9
GRID_M = 1e-4
"""Points nearer than this are one."""
STANDING_WIDTH_M = 0.6
MIN_ROOM_M2 = 1.0
THICKEST_WALL_M = 0.6
"""Two parallel openings this near are the two sides of one doorway."""
LOOKS = 3
"""So many beams go through what is open."""
UNKNOWN_HEIGHT_M = 2.5
"""Of walls, where the up beam never met a ceiling."""

Array = NDArray[np.float64]
Lines = NDArray[np.object_]
"""(n,) of shapely's LineString."""


@dataclass(frozen=True, slots=True)
class Opening:
    """A gap in a wall through which the drone has looked or flown, local NED."""

    start_ne_m: Vector2
    end_ne_m: Vector2

    @property
    def width_m(self) -> float:
        return math.dist(self.start_ne_m, self.end_ne_m)


@dataclass(frozen=True, slots=True)
class Room:
    """A closed outline, local NED, with holes for what stands in the room."""

    name: str
    outline_ne_m: tuple[Vector2, ...]
    """The corners once round; the first is not repeated."""
    holes_ne_m: tuple[tuple[Vector2, ...], ...]
    area_m2: float

    @property
    def polygon(self) -> Polygon:
        """X east, y north."""
        return Polygon(_xy(self.outline_ne_m), [_xy(hole) for hole in self.holes_ne_m])

    @property
    def label_ne_m(self) -> Vector2:
        """A place well inside, for its name."""
        point = shapely.maximum_inscribed_circle(self.polygon, tolerance=0.05).coords[0]
        return point[1], point[0]


@dataclass(frozen=True, slots=True)
class Survey:
    """The map and what was read out of it."""

    plan: FloorPlan
    rooms: tuple[Room, ...]
    """The largest first."""
    openings: tuple[Opening, ...]

    @property
    def height_m(self) -> float:
        """Of walls and ceiling above the floor that the drone took off from."""
        return UNKNOWN_HEIGHT_M if self.plan.ceiling_m is None else self.plan.ceiling_m


def survey(plan: FloorPlan) -> Survey:
    """Find the rooms and openings of a map."""
    looks = _looks(plan)
    cuts = _cuts(plan.walls, looks)
    faces = _faces(plan.walls, cuts)
    rooms = _rooms(faces, cuts, looks)
    return Survey(plan, _named(rooms), _openings(cuts, rooms, looks))


def _line(start: Vector2, end: Vector2) -> LineString:
    return LineString(_xy([start, end]))


def _xy(points_ne_m: Sequence[Vector2]) -> list[Vector2]:
    return [(east, north) for north, east in points_ne_m]


def _looks(plan: FloorPlan) -> Lines:
    """Beams and the path flown, as shapely's lines."""
    flown = np.array([(pose.east_m, pose.north_m) for pose in plan.path]).reshape(-1, 2)
    legs = np.stack([flown[:-1], flown[1:]], axis=1)
    return np.array(shapely.linestrings(np.concatenate([rays(plan), legs])), ndmin=1)


def _cuts(walls: Sequence[WallSegment], looks: Lines) -> list[LineString]:
    """Each wall continued beyond both ends to what it leads to, if that is near."""
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
    """What is ahead of a wall's end: the nearest wall across, or the end of one in line.

    If there is none within a doorway's width, the end of one in line that is hidden; if there is
    none of those, the corner where two continued walls meet.
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
    """The ends of another wall of the same direction that lie ahead, and not aside."""
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
    """Where, if anywhere, and if not right at the beginning."""
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
            assert isinstance(joined, Polygon)  # they have a side in common
            rooms[beside[0]] = joined
    return sorted(rooms, key=lambda room: -room.area)


def _longest_m(sides: shapely.Geometry) -> float:
    """Of its pieces: the ends of a wall's two faces do not open its inside to a room together."""
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
    """(north, east) of the corners; points on a straight line are left out."""
    straightened = ring.simplify(GRID_M)
    return tuple((y, x) for x, y in straightened.coords[:-1])


def _openings(
    cuts: Sequence[LineString], rooms: Sequence[Polygon], looks: Lines
) -> tuple[Opening, ...]:
    """Cuts along a room's outline with something to be seen through them."""
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
    """Wide enough, on a room's outline, and the drone has looked or flown through it."""
    strip = cut.buffer(GRID_M)
    return (
        cut.length >= NARROWEST_DOOR_M
        and any(room.boundary.intersection(strip).length > cut.length / 2 for room in rooms)
        and _is_open(cut, looks)
    )


def _is_open(cut: LineString, looks: Lines) -> bool:
    return int(np.count_nonzero(shapely.crosses(looks, cut))) >= LOOKS

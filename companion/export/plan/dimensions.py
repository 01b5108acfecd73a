"""On which side of a wall its length is written."""

from shapely import Point

from companion.core.frames import Vector2
from companion.core.messages import WallSegment
from companion.export.plan.survey import Survey

MIN_LENGTH_M = 0.6
"""Shorter pieces are drawn, not dimensioned."""
OFF_M = 0.35
BESIDE_M = 0.1
THICKEST_WALL_M = 0.6


def dimension_side_ne(survey: Survey, wall: WallSegment) -> Vector2:
    """Unit vector across the wall: outside, or into its room where the other side is a room, too.

    The two faces of a partition so have their dimensions apart.
    """
    (north_a, east_a), (north_b, east_b) = wall.start_ne_m, wall.end_ne_m
    across = (east_a - east_b) / wall.length_m, (north_b - north_a) / wall.length_m
    back = -across[0], -across[1]
    for inside, outside in ((across, back), (back, across)):
        if _is_room(survey, wall, inside, BESIDE_M):
            is_partition = _is_room(survey, wall, outside, THICKEST_WALL_M)
            return inside if is_partition else outside
    return across


def _is_room(survey: Survey, wall: WallSegment, side: Vector2, off_m: float) -> bool:
    north, east = (
        (wall.start_ne_m[axis] + wall.end_ne_m[axis]) / 2 + off_m * side[axis] for axis in (0, 1)
    )
    return any(room.polygon.contains(Point(east, north)) for room in survey.rooms)

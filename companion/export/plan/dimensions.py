"""Selects the side of a wall on which its dimension is drawn."""

from shapely import Point

from companion.core.frames import Vector2
from companion.core.messages import WallSegment
from companion.export.plan.survey import Survey

MIN_LENGTH_M = 0.6
"""Shortest wall that gets a dimension, m. Chosen."""
OFF_M = 0.35
"""Distance from a wall to its dimension line, m. Chosen."""
BESIDE_M = 0.1
"""A room contains the point this far beside the middle of its wall, m. Chosen."""
THICKEST_WALL_M = 0.6
"""Distance at which the other side of a wall is checked for a room, m. Chosen."""


def dimension_side_ne(survey: Survey, wall: WallSegment) -> Vector2:
    """Unit vector (north, east) across the wall, towards its dimension.

    The vector points out of the room. If there is a room on the other side as well, it points into
    the wall's own room, so that the dimensions of a partition's two faces do not overlap.
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

"""Makes up maps as a drone would have seen them."""

from itertools import pairwise

import shapely

from companion.core.frames import Vector2
from companion.core.messages import Beam, FloorPlan, Hit, Pose, WallSegment

THICK_M = 0.12
"""Thickness of the wall between the rooms."""


def wall(start: Vector2, end: Vector2) -> WallSegment:
    return WallSegment(start, end, 0.01, 20, 0.01)


def ring(*corners: Vector2) -> list[WallSegment]:
    return [wall(a, b) for a, b in pairwise((*corners, corners[0]))]


def seen(walls: list[WallSegment], *places: Vector2) -> FloorPlan:
    """A map of walls that the drone saw from places; beams to each half metre of each wall."""
    path = [Pose(float(number), *place, -1.2, 0.0) for number, place in enumerate(places)]
    surfaces = shapely.MultiLineString([[each.start_ne_m, each.end_ne_m] for each in walls])
    hits = [
        Hit(pose.time_s, Beam.FRONT, (north_m, east_m, -1.2), 0.01, number)
        for pose in path
        for number, each in enumerate(walls)
        for north_m, east_m in met_at(each)
        if is_met(pose.ne_m, (north_m, east_m), surfaces)
    ]
    return FloorPlan(walls=tuple(walls), hits=tuple(hits), path=tuple(path), ceiling_m=2.5)


def met_at(surface: WallSegment) -> list[Vector2]:
    """Places each half metre on a wall, its middle if it is short."""
    line = shapely.LineString([surface.start_ne_m, surface.end_ne_m])
    steps = max(2, int(2 * surface.length_m))
    points = (line.interpolate(number / steps, normalized=True) for number in range(1, steps))
    return [(point.x, point.y) for point in points]


def is_met(eye: Vector2, end: Vector2, surfaces: shapely.MultiLineString) -> bool:
    """True if no surface is in the way of a beam."""
    beam = shapely.LineString([eye, end])
    return beam.intersection(surfaces).distance(shapely.Point(eye)) > beam.length - 0.01


def two_rooms() -> FloorPlan:
    """Rooms of 4 m by 5 m on either side of a wall, a cupboard in the first."""
    first = ring((0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0))
    second = ring(
        (0.0, 4.0 + THICK_M), (5.0, 4.0 + THICK_M), (5.0, 8.0 + THICK_M), (0.0, 8.0 + THICK_M)
    )
    cupboard = ring((2.0, 1.0), (2.5, 1.2), (2.4, 1.7), (1.9, 1.5))
    return seen([*first, *second, *cupboard], (4.0, 2.0), (1.0, 2.0), (2.5, 6.0))


def two_rooms_with_a_doorway(width_m: float) -> FloorPlan:
    """Rooms of 4 m by 5 m on either side of a wall with a doorway, which begins 1 m along it."""
    last_m, second_m = 1.0 + width_m, 4.0 + THICK_M
    surfaces = [
        wall(start, end)
        for east_m in (4.0, second_m)
        for start, end in (((0.0, east_m), (1.0, east_m)), ((last_m, east_m), (5.0, east_m)))
    ]
    outer = [
        wall((0.0, 4.0), (0.0, 0.0)),
        wall((0.0, 0.0), (5.0, 0.0)),
        wall((5.0, 0.0), (5.0, 4.0)),
        wall((5.0, second_m), (5.0, 4.0 + second_m)),
        wall((5.0, 4.0 + second_m), (0.0, 4.0 + second_m)),
        wall((0.0, 4.0 + second_m), (0.0, second_m)),
    ]
    middle_m = 1.0 + width_m / 2
    places = (4.0, 2.0), (middle_m, 2.0), (middle_m, 4.0 + THICK_M / 2), (middle_m, 6.0), (4.0, 6.0)
    return seen([*outer, *surfaces], *places)

"""Turns a map on the paper: its main walls, the first heading of the flight, or north is up."""

import cmath
import math
from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum

from companion.core.frames import Vector2, Vector3, ned_to_frd, wrap_rad
from companion.core.messages import FloorPlan, WallSegment

ASLANT_RAD = math.radians(10)
"""Angle from which on a wall is aslant, rad. Chosen."""


class Up(StrEnum):
    """What is up on the paper."""

    WALLS = "walls"
    """The direction of the main walls that is nearest to the first heading."""
    TAKE_OFF = "take-off"
    """The drone's first heading, north of the map's frame."""
    NORTH = "north"
    """True north, by the true heading at take-off."""


def up_rad(plan: FloorPlan, up: Up, heading_rad: float) -> float:
    """Heading, in the map's frame, of what is up on the paper.

    `heading_rad`: true heading at take-off.
    """
    match up:
        case Up.WALLS:
            return main_direction_rad(plan.walls)
        case Up.TAKE_OFF:
            return 0.0
        case Up.NORTH:
            return wrap_rad(-heading_rad)


def main_direction_rad(walls: Sequence[WallSegment]) -> float:
    """Mean direction of the main walls, by length and modulo a right angle, between -45° and 45°.

    Walls that are `ASLANT_RAD` off the mean of all count no more.
    """
    turns = [(wall.length_m, 4 * _heading_rad(wall)) for wall in walls]
    mean_rad = _mean_rad(turns)
    main = [each for each in turns if abs(wrap_rad(each[1] - mean_rad)) < 4 * ASLANT_RAD]
    return _mean_rad(main or turns) / 4


def _mean_rad(turns: Sequence[tuple[float, float]]) -> float:
    """Mean of angles, rad, by their weights."""
    total = sum((cmath.rect(weight, angle_rad) for weight, angle_rad in turns), start=0j)
    return cmath.phase(total) if total else 0.0


def turned(plan: FloorPlan, up_rad: float) -> FloorPlan:
    """The same map in a frame whose x axis has this heading, rad; the origin stays."""

    def level(place: Vector2) -> Vector2:
        return ned_to_frd(*place, up_rad)

    def spatial(place: Vector3) -> Vector3:
        return (*level((place[0], place[1])), place[2])

    return replace(
        plan,
        walls=tuple(
            replace(wall, start_ne_m=level(wall.start_ne_m), end_ne_m=level(wall.end_ne_m))
            for wall in plan.walls
        ),
        hits=tuple(replace(hit, position_ned_m=spatial(hit.position_ned_m)) for hit in plan.hits),
        path=tuple(
            replace(pose, north_m=north_m, east_m=east_m, yaw_rad=wrap_rad(pose.yaw_rad - up_rad))
            for pose in plan.path
            for north_m, east_m in (level(pose.ne_m),)
        ),
        tops=tuple(replace(top, centre_ne_m=level(top.centre_ne_m)) for top in plan.tops),
    )


def to_xy(point_ne_m: Vector2) -> Vector2:
    """North and east of a turned map as x and y on the paper, m."""
    return point_ne_m[1], point_ne_m[0]


def extent_m(plan: FloorPlan, *, with_path: bool) -> tuple[float, float, float, float]:
    """West, south, east and north edge of the walls, and of the path; of a point without both."""
    corners = [end for wall in plan.walls for end in (wall.start_ne_m, wall.end_ne_m)]
    if with_path or not corners:
        corners += [pose.ne_m for pose in plan.path]
    north_m, east_m = zip(*(corners or [(0.0, 0.0)]), strict=True)
    return min(east_m), min(north_m), max(east_m), max(north_m)


def _heading_rad(wall: WallSegment) -> float:
    (north_a, east_a), (north_b, east_b) = wall.start_ne_m, wall.end_ne_m
    return math.atan2(east_b - east_a, north_b - north_a)

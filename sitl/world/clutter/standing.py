"""What stands in a world between two heights, and the faces of its walls that can be seen."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import dist
from typing import Protocol

from companion.core.frames import Vector2
from sitl.world.clutter.pieces import Spot
from sitl.world.format import Panel, Segment, World

MESH_STEP_M = 0.2
"""Between the heights at which an imported mesh is cut; chosen, half a drone's."""
MIN_FACE_M = 0.3
"""Shorter faces are corners and ragged cells of maps; chosen."""
FACE_HEIGHT_M = 1.2
"""A face reaches at least from below to above it: the usual height of flight."""
ASIDE_M = 0.3
"""From a face to where the floor before it is looked for; chosen, wider than a jagged wall."""
OFF_WALL_M = 0.02
"""What is before a face begins so far from it; chosen, more than the gap between two pieces."""
LOOK_EVERY_M = 0.5
"""Along a face, for floor before it; chosen, a door's half."""


class Floor(Protocol):
    """Which places can be got to."""

    def is_open(self, near: Vector2, far: Vector2) -> bool: ...


@dataclass(frozen=True, slots=True)
class Face:
    """One side of a wall: from `spot` along its width, the room in the direction of its depth."""

    spot: Spot
    length_m: float
    bottom_m: float
    top_m: float


def standing(world: World, low_m: float, high_m: float) -> list[Segment]:
    """Segments, (north, east) in metres, of all that is anywhere between two heights."""
    found: list[Segment] = list(world.closed_border)
    for panel in world.panels:
        if panel.bottom_m < high_m and panel.top_m > low_m:
            found += panel.outline
    for box in world.boxes:
        if box.bottom_m < high_m and box.top_m > low_m:
            found += box.segments
    if world.mesh is not None:
        steps = max(1, round((high_m - low_m) / MESH_STEP_M))
        for number in range(steps + 1):
            found += world.mesh.section(low_m + (high_m - low_m) * number / steps)
    return found


def faces_of(world: World, floor: Floor) -> list[Face]:
    """Sides of walls, not of furniture, with floor inside before them."""
    return [
        face
        for segment, bottom_m, top_m in _walls(world)
        if dist(*segment) >= MIN_FACE_M
        for face in _sides(segment, bottom_m, top_m)
        if _has_floor(face, floor)
    ]


def length_of(faces: list[Face]) -> float:
    """Metres of wall."""
    return sum(face.length_m for face in faces)


def _walls(world: World) -> Iterator[tuple[Segment, float, float]]:
    """Segments that stand at the height of flight, with their least and greatest heights."""
    for panel in world.panels:
        if _is_at_flight(panel):
            for segment in panel.outline:
                yield segment, panel.bottom_m, panel.top_m
    if world.mesh is not None:
        for segment in world.mesh.section(FACE_HEIGHT_M):
            yield segment, 0.0, world.height_m


def _is_at_flight(panel: Panel) -> bool:
    return panel.bottom_m <= FACE_HEIGHT_M <= panel.top_m and not panel.glass


def _sides(segment: Segment, bottom_m: float, top_m: float) -> Iterator[Face]:
    length_m = dist(*segment)
    for start, end in (segment, segment[::-1]):
        along = (end[0] - start[0]) / length_m, (end[1] - start[1]) / length_m
        yield Face(Spot(start, along), length_m, bottom_m, top_m)


def _has_floor(face: Face, floor: Floor) -> bool:
    looks = max(1, round(face.length_m / LOOK_EVERY_M))
    return any(
        floor.is_open(face.spot.at(x_m, OFF_WALL_M), face.spot.at(x_m, ASIDE_M))
        for x_m in (face.length_m * (number + 0.5) / looks for number in range(looks))
    )

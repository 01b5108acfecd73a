"""Finds the objects of a world between two heights, and the visible faces of its walls."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import dist
from typing import Protocol

from companion.core.frames import Vector2
from sitl.world.clutter.pieces import Spot
from sitl.world.format import Panel, Segment, World

MESH_STEP_M = 0.2
"""Distance of the heights at which an imported mesh is cut, m. Chosen: half a drone's height."""
MIN_FACE_M = 0.3
"""Shorter faces are corners and ragged map cells, m. Chosen."""
FACE_HEIGHT_M = 1.2
"""A face contains this height, m: the usual flight height."""
ASIDE_M = 0.3
"""Distance from a face at which free floor is required, m. Chosen: wider than a jagged wall."""
OFF_WALL_M = 0.02
"""Distance from a face to a piece before it, m. Chosen: more than the gap between two pieces."""
LOOK_EVERY_M = 0.5
"""Distance of the checks for free floor along a face, m. Chosen: half a door."""


class Floor(Protocol):
    """Interface for checks of free floor."""

    def is_open(self, near: Vector2, far: Vector2) -> bool: ...


@dataclass(frozen=True, slots=True)
class Face:
    """One side of a wall: from `spot` along its width, with the room in depth direction."""

    spot: Spot
    length_m: float
    bottom_m: float
    top_m: float


def standing(world: World, low_m: float, high_m: float) -> list[Segment]:
    """Segments, (north, east) in m, of all objects between two heights."""
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
    """Sides of walls, not of furniture, that have free floor before them."""
    return [
        face
        for segment, bottom_m, top_m in _walls(world)
        if dist(*segment) >= MIN_FACE_M
        for face in _sides(segment, bottom_m, top_m)
        if _has_floor(face, floor)
    ]


def length_of(faces: list[Face]) -> float:
    """Total length of the faces, m."""
    return sum(face.length_m for face in faces)


def _walls(world: World) -> Iterator[tuple[Segment, float, float]]:
    """Segments at flight height with their bottom and top heights."""
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

"""A world as triangles: vertices (n, 3) in NED metres, faces (m, 3) of vertex numbers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.frames import Vector2, Vector3
from sitl.world.format import World

MARGIN_M = 2.0
"""Floor and ceiling reach this far beyond the outermost wall."""


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles that have been checked: finite, with faces that name existing vertices."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]

    def __post_init__(self) -> None:
        if not len(self.faces):
            raise ValueError("a mesh needs at least one triangle")
        if not np.isfinite(self.vertices).all():
            raise ValueError("a mesh has vertices that are not finite")
        if self.faces.min() < 0 or self.faces.max() >= len(self.vertices):
            raise ValueError("a mesh has faces that name no vertex")


def _from_quads(quads: list[tuple[Vector3, Vector3, Vector3, Vector3]]) -> Mesh:
    first = 4 * np.arange(len(quads))[:, None]
    faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    return Mesh(np.array(quads, dtype=float).reshape(-1, 3), faces)


def obstacle_mesh(world: World) -> Mesh:
    """Walls, boxes and ceiling: all that the drone must not touch."""
    quads = []
    for panel in world.panels:
        sides = panel.outline
        quads += [_upright(start, end, panel.bottom_m, panel.top_m) for start, end in sides]
        if len(sides) > 1:
            corners = [start for start, _ in sides]
            quads += [_level(corners, panel.top_m), _level(corners, panel.bottom_m)]
    for box in world.boxes:
        quads += [_upright(start, end, box.bottom_m, box.top_m) for start, end in box.segments]
        corners = [start for start, _ in box.segments]
        quads += [_level(corners, box.top_m), _level(corners, box.bottom_m)]
    quads.append(_level(_bounds(world), world.height_m))
    return _from_quads(quads)


def full_mesh(world: World) -> Mesh:
    """The obstacles and the floor: all that a beam can meet."""
    obstacles = obstacle_mesh(world)
    floor = _from_quads([_level(_bounds(world), 0.0)])
    return Mesh(
        np.concatenate([obstacles.vertices, floor.vertices]),
        np.concatenate([obstacles.faces, floor.faces + len(obstacles.vertices)]),
    )


def _upright(
    start: Vector2, end: Vector2, bottom_m: float, top_m: float
) -> tuple[Vector3, Vector3, Vector3, Vector3]:
    return (
        (*start, -bottom_m),
        (*end, -bottom_m),
        (*end, -top_m),
        (*start, -top_m),
    )


def _level(corners: list[Vector2], height_m: float) -> tuple[Vector3, Vector3, Vector3, Vector3]:
    a, b, c, d = corners
    return (*a, -height_m), (*b, -height_m), (*c, -height_m), (*d, -height_m)


def _bounds(world: World) -> list[Vector2]:
    sides = [side for panel in world.panels for side in panel.outline]
    sides += [side for box in world.boxes for side in box.segments]
    points = [point for side in sides for point in side]
    norths, easts = [p[0] for p in points], [p[1] for p in points]
    south, north = min(norths) - MARGIN_M, max(norths) + MARGIN_M
    west, east = min(easts) - MARGIN_M, max(easts) + MARGIN_M
    return [(south, west), (north, west), (north, east), (south, east)]

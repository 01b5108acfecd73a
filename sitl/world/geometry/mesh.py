"""Converts a world to triangles."""

import numpy as np

from companion.core.frames import Vector2, Vector3
from sitl.world.format import Panel, World
from sitl.world.geometry.triangles import Mesh

MARGIN_M = 2.0
"""Margin of floor and ceiling beyond the outermost wall, m. Chosen."""
FLOOR_M = 0.05
"""Parts of an imported mesh below this height are floor, carpet or doorstep, m. Chosen."""


def _from_quads(quads: list[tuple[Vector3, Vector3, Vector3, Vector3]]) -> Mesh:
    first = 4 * np.arange(len(quads))[:, None]
    faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    return Mesh(np.array(quads, dtype=float).reshape(-1, 3), faces)


def obstacle_mesh(world: World) -> Mesh:
    """Surfaces that a drone can hit: walls, boxes, ceiling, imported mesh above its floor."""
    imported = world.mesh.above(FLOOR_M) if world.mesh is not None else None
    built = _built(world, world.panels)
    return built if imported is None else built + imported


def visible_mesh(world: World) -> Mesh:
    """Surfaces that a beam can hit, also carpets, but neither glass nor the floor plane."""
    built = _built(world, [panel for panel in world.panels if not panel.glass])
    return built if world.mesh is None else built + world.mesh


def _built(world: World, panels: list[Panel]) -> Mesh:
    """Walls, boxes, ceiling, and walls along the closed border."""
    quads = [_upright(*segment, 0.0, world.height_m) for segment in world.closed_border]
    for panel in panels:
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
    corners = [*world.bounds, *(point for segment in world.closed_border for point in segment)]
    (south, west), (north, east) = np.min(corners, axis=0), np.max(corners, axis=0)
    south, west = south - MARGIN_M, west - MARGIN_M
    north, east = north + MARGIN_M, east + MARGIN_M
    return [(south, west), (north, west), (north, east), (south, east)]

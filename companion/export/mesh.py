"""Writes GLB: floor, walls, ceiling and openings as four meshes; m, y up (glTF).

Walls are the measured surfaces, without thickness.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import shapely
import trimesh
from trimesh.visual.material import PBRMaterial

from companion.core.arrays import Array
from companion.core.errors import OutputError
from companion.core.frames import Vector2, ned_to_gltf
from companion.export.plan.survey import Survey

WALL, FLOOR, CEILING, OPENING = (
    (0.80, 0.82, 0.84, 1.0),
    (0.62, 0.55, 0.46, 1.0),
    (0.93, 0.93, 0.92, 0.25),
    (0.25, 0.60, 0.85, 0.35),
)
"""Red, green, blue, opacity, 0 to 1. The ceiling is transparent: the view is from above."""


def write_glb(survey: Survey, path: Path) -> None:
    """Write the meshes.

    Raises:
        OutputError: the map has no walls; the library cannot write an empty scene.
    """
    if not survey.plan.walls:
        raise OutputError(f"{path}: the map has no walls")
    height_m = survey.height_m
    walls = [(wall.start_ne_m, wall.end_ne_m) for wall in survey.plan.walls]
    openings = [(opening.start_ne_m, opening.end_ne_m) for opening in survey.openings]
    scene = trimesh.Scene()
    for name, triangles, colour in (
        ("walls", _upright(walls, height_m), WALL),
        ("openings", _upright(openings, height_m), OPENING),
        ("floor", _level(survey, 0.0), FLOOR),
        ("ceiling", _level(survey, height_m), CEILING),
    ):
        if len(triangles):
            scene.add_geometry(_mesh(triangles, name, colour), node_name=name, geom_name=name)
    path.write_bytes(scene.export(file_type="glb"))


def _upright(segments: Sequence[tuple[Vector2, Vector2]], height_m: float) -> Array:
    triangles = []
    for (north_a, east_a), (north_b, east_b) in segments:
        low_a, low_b = ned_to_gltf((north_a, east_a, 0.0)), ned_to_gltf((north_b, east_b, 0.0))
        high_a = ned_to_gltf((north_a, east_a, -height_m))
        high_b = ned_to_gltf((north_b, east_b, -height_m))
        triangles += [(low_a, low_b, high_b), (low_a, high_b, high_a)]
    return np.array(triangles).reshape(-1, 3, 3)


def _level(survey: Survey, height_m: float) -> Array:
    triangles = [
        [ned_to_gltf((north, east, -height_m)) for east, north in triangle.exterior.coords[:3]]
        for room in survey.rooms
        for triangle in shapely.constrained_delaunay_triangles(room.polygon).geoms
        if isinstance(triangle, shapely.Polygon)
    ]
    return np.array(triangles).reshape(-1, 3, 3)


def _mesh(
    triangles: Array, name: str, colour: tuple[float, float, float, float]
) -> trimesh.Trimesh:
    material = PBRMaterial(
        name=name,
        baseColorFactor=np.array(colour),
        metallicFactor=0.0,
        roughnessFactor=0.9,
        doubleSided=True,
        alphaMode="OPAQUE" if colour[3] == 1 else "BLEND",
    )
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles))
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh

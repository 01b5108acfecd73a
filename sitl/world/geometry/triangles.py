"""Represents triangles: vertices (n, 3) in NED, m, and faces (m, 3) of vertex numbers."""

from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Indices
from companion.core.frames import Vector2
from sitl.world.geometry.polylines import join, legs, simplify

SAME_WITHIN_M = 1e-4
"""Ends of a section's segments within this are joined, m."""
STRAIGHT_WITHIN_M = 0.002
"""Tolerance of simplifying a section, m."""


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Validated triangles: finite, and faces refer to existing vertices.

    FCL crashes the process on others.
    """

    vertices: Array
    faces: Indices

    def __post_init__(self) -> None:
        if not len(self.faces):
            raise ValueError("a mesh needs at least one triangle")
        if not np.isfinite(self.vertices).all():
            raise ValueError("a mesh has vertices that are not finite")
        if self.faces.min() < 0 or self.faces.max() >= len(self.vertices):
            raise ValueError("a mesh has faces that name no vertex")

    @property
    def extremes(self) -> Array:
        """Minimum and maximum north, east and down of the faces, (2, 3), m."""
        used = self.vertices[self.faces.reshape(-1)]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    def __add__(self, other: "Mesh") -> "Mesh":
        """Concatenate two meshes."""
        return Mesh(
            np.concatenate([self.vertices, other.vertices]),
            np.concatenate([self.faces, other.faces + len(self.vertices)]),
        )

    def above(self, height_m: float) -> "Mesh | None":
        """The mesh without triangles wholly below a height; None if none remains."""
        reaches = (self.vertices[self.faces, 2] < -height_m).any(axis=1)
        return Mesh(self.vertices, self.faces[reaches]) if reaches.any() else None

    def section(self, height_m: float) -> list[tuple[Vector2, Vector2]]:
        """Cut at a height, seen from above: segments of (north, east), m."""
        import trimesh  # noqa: PLC0415 - slow to load, and only needed for plans

        solid = trimesh.Trimesh(self.vertices, self.faces, process=False)
        cut = trimesh.intersections.mesh_plane(solid, (0, 0, -1), (0, 0, -height_m))
        lines = join(np.asarray(cut, dtype=float).reshape(-1, 2, 3)[..., :2], SAME_WITHIN_M)
        return [leg for line in lines for leg in legs(simplify(line, STRAIGHT_WITHIN_M))]

"""Triangles: vertices (n, 3) in NED metres, faces (m, 3) of vertex numbers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import Vector2
from sitl.world.geometry.polylines import join, legs, simplify

SAME_WITHIN_M = 1e-4
STRAIGHT_WITHIN_M = 0.002


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles that have been checked: finite, with faces that name existing vertices.

    FCL takes the process down with it when it is given others.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]

    def __post_init__(self) -> None:
        if not len(self.faces):
            raise ValueError("a mesh needs at least one triangle")
        if not np.isfinite(self.vertices).all():
            raise ValueError("a mesh has vertices that are not finite")
        if self.faces.min() < 0 or self.faces.max() >= len(self.vertices):
            raise ValueError("a mesh has faces that name no vertex")

    @property
    def extremes(self) -> NDArray[np.float64]:
        """The least and the greatest north, east and down of any face; (2, 3)."""
        used = self.vertices[self.faces.reshape(-1)]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    def __add__(self, other: "Mesh") -> "Mesh":
        """Both, as one."""
        return Mesh(
            np.concatenate([self.vertices, other.vertices]),
            np.concatenate([self.faces, other.faces + len(self.vertices)]),
        )

    def above(self, height_m: float) -> "Mesh | None":
        """Without the triangles that lie wholly below a height; None if that is all of them."""
        reaches = (self.vertices[self.faces, 2] < -height_m).any(axis=1)
        return Mesh(self.vertices, self.faces[reaches]) if reaches.any() else None

    def section(self, height_m: float) -> list[tuple[Vector2, Vector2]]:
        """What it looks like cut at a height, seen from above: segments of (north, east)."""
        import trimesh  # noqa: PLC0415 - slow to load, and only needed for plans

        solid = trimesh.Trimesh(self.vertices, self.faces, process=False)
        cut = trimesh.intersections.mesh_plane(solid, (0, 0, -1), (0, 0, -height_m))
        lines = join(np.asarray(cut, dtype=float).reshape(-1, 2, 3)[..., :2], SAME_WITHIN_M)
        return [leg for line in lines for leg in legs(simplify(line, STRAIGHT_WITHIN_M))]

"""Intersects rays with triangles exactly. A triangle is stored as one corner and two edges."""

import math
from typing import NamedTuple

import numpy as np

from companion.core.frames import Vector3
from sitl.world.geometry.triangles import Mesh

EDGE_TOLERANCE = 1e-9
"""Margin at a triangle's edge, barycentric, so that no ray passes between two triangles."""
PARALLEL = 1e-14
"""Twice the projected area, m², below which a ray is parallel to the triangle's plane."""


class Triangle(NamedTuple):
    """A corner in NED, m, and the edges e1, e2 from it to the other two."""

    ax: float
    ay: float
    az: float
    e1x: float
    e1y: float
    e1z: float
    e2x: float
    e2y: float
    e2z: float


def triangles_of(mesh: Mesh) -> list[Triangle]:
    """Triangles in the order of the mesh's faces."""
    a, b, c = (mesh.vertices[corner] for corner in mesh.faces.T)
    return list(map(Triangle._make, np.hstack([a, b - a, c - a]).tolist()))


def distance_m(origin: Vector3, direction: Vector3, triangle: Triangle) -> float:
    """Distance along the ray to the triangle, m; infinite without intersection.

    Möller and Trumbore 1997. With P = direction × e2, T = origin - corner, Q = T × e1:
    det = e1·P, u = T·P / det, v = direction·Q / det, distance = e2·Q / det.
    """
    ax, ay, az, e1x, e1y, e1z, e2x, e2y, e2z = triangle
    dx, dy, dz = direction
    px, py, pz = dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x
    det = e1x * px + e1y * py + e1z * pz
    if -PARALLEL < det < PARALLEL:
        return math.inf
    tx, ty, tz = origin[0] - ax, origin[1] - ay, origin[2] - az
    u = (tx * px + ty * py + tz * pz) / det
    if not -EDGE_TOLERANCE <= u <= 1 + EDGE_TOLERANCE:
        return math.inf
    qx, qy, qz = ty * e1z - tz * e1y, tz * e1x - tx * e1z, tx * e1y - ty * e1x
    v = (dx * qx + dy * qy + dz * qz) / det
    if v < -EDGE_TOLERANCE or u + v > 1 + EDGE_TOLERANCE:
        return math.inf
    ahead_m = (e2x * qx + e2y * qy + e2z * qz) / det
    return ahead_m if ahead_m >= 0 else math.inf


def cos_incidence(direction: Vector3, triangle: Triangle) -> float:
    """Cosine of the angle between a ray and the triangle's normal, on either side."""
    _, _, _, e1x, e1y, e1z, e2x, e2y, e2z = triangle
    nx, ny, nz = e1y * e2z - e1z * e2y, e1z * e2x - e1x * e2z, e1x * e2y - e1y * e2x
    dx, dy, dz = direction
    return abs(dx * nx + dy * ny + dz * nz) / math.hypot(nx, ny, nz)

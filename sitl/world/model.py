"""Ranges, clearance and collision in a world, by FCL.

FCL casts no rays. A range is found by colliding a box as thin as 1 mm, laid along the beam, with
the world's triangles, and intersecting the few triangles that it touches exactly; contact
positions of FCL are not used, they can be metres off.
"""

import math
from collections.abc import Iterable

import fcl
import numpy as np

from companion.frames import Vector3
from sitl.world.format import Box, World
from sitl.world.mesh import full_mesh, obstacle_mesh
from sitl.world.triangles import Mesh

BODY_RADIUS_M = 0.2
"""The drone with its propellers is a sphere of this radius."""
BEAM_WIDTH_M = 0.001
MOST_CONTACTS = 1000
FAR_M = 1.0
EDGE_TOLERANCE = 1e-9
"""A ray this near a triangle's edge, in barycentric terms, meets it: no ray slips between two."""

Triangle = tuple[Vector3, Vector3, Vector3]


class WorldModel:
    """A world to range in and to bump into. All positions are world NED, metres."""

    def __init__(self, world: World) -> None:
        self._boxes = world.boxes
        everything = full_mesh(world)
        self._everything = _collision_object(everything)
        self._triangles = _triangles(everything)
        self._obstacles = _collision_object(obstacle_mesh(world))
        self._body = fcl.CollisionObject(fcl.Sphere(BODY_RADIUS_M))
        self._request = fcl.CollisionRequest(num_max_contacts=MOST_CONTACTS, enable_contact=False)
        self._beams: dict[float, fcl.CollisionObject] = {}
        self._checked_at: Vector3 | None = None
        self._clearance_m = 0.0

    def range_m(self, origin: Vector3, direction: Vector3, most_m: float) -> float | None:
        """Distance along a unit direction to the first surface within `most_m`, or None."""
        _check_finite((*origin, *direction))
        beam = self._beams.get(most_m)
        if beam is None:
            beam = fcl.CollisionObject(fcl.Box(BEAM_WIDTH_M, BEAM_WIDTH_M, most_m))
            self._beams[most_m] = beam
        half_m = 0.5 * most_m
        (x, y, z), (dx, dy, dz) = origin, direction
        middle = np.array((x + half_m * dx, y + half_m * dy, z + half_m * dz))
        beam.setTransform(fcl.Transform(_rotation_to(direction), middle))
        result = fcl.CollisionResult()
        fcl.collide(self._everything, beam, self._request, result)
        touched = {contact.b1 for contact in result.contacts}
        return _nearest(origin, direction, (self._triangles[i] for i in touched), most_m)

    def clearance_m(self, position: Vector3) -> float:
        """Distance of a point to anything but the floor; 0 inside a solid."""
        if any(_is_inside(box, position) for box in self._boxes):
            return 0.0
        return max(self._body_distance(position) + BODY_RADIUS_M, 0.0)

    def body_clearance_m(self, position: Vector3) -> float:
        """Distance of the drone's body to anything but the floor, ≤ 0 when it touches.

        Exact whenever it may be a new least one: a body that has moved by s since the last exact
        answer c is at least c - s away, and that bound is returned while it is above `FAR_M`.
        """
        if self._checked_at is not None:
            bound_m = self._clearance_m - math.dist(position, self._checked_at)
            if bound_m > FAR_M:
                return bound_m
        self._checked_at = position
        self._clearance_m = self.clearance_m(position) - BODY_RADIUS_M
        return self._clearance_m

    def _body_distance(self, position: Vector3) -> float:
        _check_finite(position)
        self._body.setTranslation(np.array(position))
        result = fcl.DistanceResult()
        return float(fcl.distance(self._obstacles, self._body, fcl.DistanceRequest(), result))


def _collision_object(mesh: Mesh) -> fcl.CollisionObject:
    bvh = fcl.BVHModel()
    bvh.beginModel(len(mesh.faces), len(mesh.vertices))
    bvh.addSubModel(mesh.vertices, mesh.faces)
    bvh.endModel()
    return fcl.CollisionObject(bvh)


def _triangles(mesh: Mesh) -> list[Triangle]:
    """Python floats, with which one ray is intersected faster than with arrays."""
    corners: list[Vector3] = [(x, y, z) for x, y, z in mesh.vertices.tolist()]
    return [(corners[a], corners[b], corners[c]) for a, b, c in mesh.faces.tolist()]


def _check_finite(values: tuple[float, ...]) -> None:
    """FCL answers nonsense to NaN without a word."""
    if not all(map(math.isfinite, values)):
        raise ValueError(f"not a finite pose: {values}")


def _rotation_to(direction: Vector3) -> np.ndarray:
    """The quaternion (w, x, y, z) that turns the z axis to the direction, half-way round."""
    x, y, z = direction
    if z < -1 + 1e-9:
        return np.array((0.0, 1.0, 0.0, 0.0))
    # (1 + z0·d, z0 × d), normalised
    scale = 1 / math.sqrt(2 * (1 + z))
    return np.array(((1 + z) * scale, -y * scale, x * scale, 0.0))


def _nearest(
    origin: Vector3, direction: Vector3, triangles: Iterable[Triangle], most_m: float
) -> float | None:
    hits = (_intersect(origin, direction, triangle) for triangle in triangles)
    ahead = [hit for hit in hits if hit is not None and 0 <= hit <= most_m]
    return min(ahead, default=None)


def _intersect(origin: Vector3, direction: Vector3, triangle: Triangle) -> float | None:
    """Möller and Trumbore 1997: distance along the ray to the triangle's plane, if inside it."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = triangle
    dx, dy, dz = direction
    e1x, e1y, e1z = bx - ax, by - ay, bz - az
    e2x, e2y, e2z = cx - ax, cy - ay, cz - az
    px, py, pz = dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x
    det = e1x * px + e1y * py + e1z * pz
    if abs(det) < 1e-14:
        return None
    tx, ty, tz = origin[0] - ax, origin[1] - ay, origin[2] - az
    u = (tx * px + ty * py + tz * pz) / det
    if not -EDGE_TOLERANCE <= u <= 1 + EDGE_TOLERANCE:
        return None
    qx, qy, qz = ty * e1z - tz * e1y, tz * e1x - tx * e1z, tx * e1y - ty * e1x
    v = (dx * qx + dy * qy + dz * qz) / det
    if v < -EDGE_TOLERANCE or u + v > 1 + EDGE_TOLERANCE:
        return None
    return (e2x * qx + e2y * qy + e2z * qz) / det


def _is_inside(box: Box, position: Vector3) -> bool:
    north, east, down = position
    return (
        box.corner[0] <= north <= box.corner[0] + box.size[0]
        and box.corner[1] <= east <= box.corner[1] + box.size[1]
        and box.bottom_m <= -down <= box.top_m
    )

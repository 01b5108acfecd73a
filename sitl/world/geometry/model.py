"""Computes ranges, clearance and collisions in a world with FCL.

FCL has no ray casting. A range is found by colliding a box 1 mm thin, along the beam, with the
world's triangles, and intersecting the touched triangles exactly. FCL's contact positions are not
used: they can be metres off. The floor is a plane, and no obstacle.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import fcl
import numpy as np

from companion.core.frames import Vector3
from sitl.world.format import Box, World
from sitl.world.geometry.mesh import obstacle_mesh, visible_mesh
from sitl.world.geometry.rays import Triangle, cos_incidence, distance_m, triangles_of
from sitl.world.geometry.triangles import Mesh

BODY_RADIUS_M = 0.2
"""Radius of the sphere that represents the drone with its propellers, m."""
BEAM_WIDTH_M = 0.001
"""Width of the box along a beam, m."""


class Hit(NamedTuple):
    """The point where a ray ends."""

    distance_m: float
    cos_incidence: float
    """Cosine of the angle between ray and surface normal: 1 head-on, 0 grazing."""


class WorldModel:
    """Answers range, clearance and collision queries. Positions are world NED, m."""

    def __init__(self, world: World) -> None:
        visible = visible_mesh(world)
        self._boxes = world.boxes
        self._visible = _collision_object(visible)
        self._triangles = triangles_of(visible)
        same = world.mesh is None and not any(walls.glass for walls in world.walls)
        self._obstacles = self._visible if same else _collision_object(obstacle_mesh(world))
        self._body = fcl.CollisionObject(fcl.Sphere(BODY_RADIUS_M))
        self._request = fcl.CollisionRequest(num_max_contacts=len(self._triangles))
        self._probes: dict[tuple[float, float], fcl.CollisionObject] = {}
        self._checked_at: Vector3 | None = None
        self._clearance_m = 0.0

    def range_m(self, origin: Vector3, direction: Vector3, most_m: float) -> float | None:
        """Distance along a unit direction to the first surface within `most_m`, or None."""
        nearest_m = _to_floor_m(origin, direction)
        for triangle in self._touched(origin, direction, most_m, BEAM_WIDTH_M):
            nearest_m = min(nearest_m, distance_m(origin, direction, triangle))
        return nearest_m if nearest_m <= most_m else None

    def hits(
        self, origin: Vector3, rays: Sequence[Vector3], most_m: float, half_angle_rad: float
    ) -> list[Hit | None]:
        """End of each ray of a bundle. The first is the axis; the others are within the angle."""
        width_m = BEAM_WIDTH_M + 2 * most_m * math.sin(half_angle_rad)
        touched = self._touched(origin, rays[0], most_m, width_m)
        return [self._hit(origin, ray, touched, most_m) for ray in rays]

    def _hit(
        self, origin: Vector3, ray: Vector3, touched: list[Triangle], most_m: float
    ) -> Hit | None:
        found = [Hit(distance_m(origin, ray, t), cos_incidence(ray, t)) for t in touched]
        nearest = min([Hit(_to_floor_m(origin, ray), abs(ray[2])), *found])
        return nearest if nearest.distance_m <= most_m else None

    def _touched(
        self, origin: Vector3, direction: Vector3, most_m: float, width_m: float
    ) -> list[Triangle]:
        """Triangles that a box around the ray touches."""
        (x, y, z), (dx, dy, dz) = origin, direction
        _check_finite(x + y + z + dx + dy + dz, origin)
        probe = self._probes.get((most_m, width_m))
        if probe is None:
            probe = fcl.CollisionObject(fcl.Box(width_m, width_m, most_m))
            self._probes[most_m, width_m] = probe
        half_m = 0.5 * most_m
        probe.setQuatRotation(_rotation_to(direction))
        probe.setTranslation(np.array((x + half_m * dx, y + half_m * dy, z + half_m * dz)))
        result = fcl.CollisionResult()
        fcl.collide(self._visible, probe, self._request, result)
        return [self._triangles[contact.b1] for contact in result.contacts]

    def clearance_m(self, position: Vector3) -> float:
        """Distance of a point to any surface except the floor, m; 0 inside a solid."""
        if any(_is_inside(box, position) for box in self._boxes):
            return 0.0
        return max(self._body_distance(position) + BODY_RADIUS_M, 0.0)

    def body_clearance_m(self, position: Vector3, exact_to_m: float) -> float:
        """Distance of the drone's body to any surface except the floor, m; ≤ 0 on contact.

        The value is exact up to `exact_to_m`. A body that has moved by s since the last exact value
        c is at least c - s away. That bound is returned while it exceeds `exact_to_m`.
        """
        if self._checked_at is not None:
            bound_m = self._clearance_m - math.dist(position, self._checked_at)
            if bound_m > exact_to_m:
                return bound_m
        self._checked_at = position
        self._clearance_m = self.clearance_m(position) - BODY_RADIUS_M
        return self._clearance_m

    def _body_distance(self, position: Vector3) -> float:
        _check_finite(sum(position), position)
        self._body.setTranslation(np.array(position))
        result = fcl.DistanceResult()
        return float(fcl.distance(self._obstacles, self._body, fcl.DistanceRequest(), result))


def _to_floor_m(origin: Vector3, direction: Vector3) -> float:
    """Distance along a ray to the floor plane (down = 0), m; infinite without intersection."""
    down, slope = origin[2], direction[2]
    reach_m = -down / slope if slope else math.inf
    return reach_m if reach_m >= 0 else math.inf


def _collision_object(mesh: Mesh) -> fcl.CollisionObject:
    bvh = fcl.BVHModel()
    bvh.beginModel(len(mesh.faces), len(mesh.vertices))
    bvh.addSubModel(mesh.vertices, mesh.faces.tolist())
    bvh.endModel()
    return fcl.CollisionObject(bvh)


def _check_finite(sum_of_pose: float, position: Vector3) -> None:
    """Reject non-finite poses: FCL returns wrong results for NaN without an error."""
    if not math.isfinite(sum_of_pose):
        raise ValueError(f"not a finite pose, at {position}")


def _rotation_to(direction: Vector3) -> tuple[float, float, float, float]:
    """The quaternion (w, x, y, z) that aligns the z axis with the direction or its opposite."""
    x, y, z = direction
    if z < 0:  # the box is symmetric, and a half turn has no unique axis
        x, y, z = -x, -y, -z
    # (1 + z0·d, z0 × d), normalised
    scale = 1 / math.sqrt(2 * (1 + z))
    return (1 + z) * scale, -y * scale, x * scale, 0.0


def _is_inside(box: Box, position: Vector3) -> bool:
    north, east, down = position
    return (
        box.corner[0] <= north <= box.corner[0] + box.size[0]
        and box.corner[1] <= east <= box.corner[1] + box.size[1]
        and box.bottom_m <= -down <= box.top_m
    )

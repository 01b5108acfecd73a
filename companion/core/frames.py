"""Coordinate frames and all conversions between them.

The program uses two frames, both right-handed with z down:

- **local NED**: origin at the take-off point; x along the first heading ("north"), y to the right
  of it ("east"), z down. Yaw is clockwise seen from above, zero at the start.
- **body FRD**: x forward, y right, z down.

Recordings and exports use their readers' conventions: ENU (x east, y north, z up) and body FLU
(x forward, y left, z up) for ROS, PLY and DXF, y up for glTF, or geographic degrees.
"""

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from companion.core.arrays import Array

Vector2 = tuple[float, float]
Vector3 = tuple[float, float, float]
HEADING = 2
"""Index of the heading, rad, in a start (3,): the origin of a frame in another; and in a pose."""
Angles = TypeVar("Angles", float, Array)
"""One angle or an array of angles, rad."""


def wrap_rad(angle_rad: Angles) -> Angles:
    """Wrap angles to [-π, π)."""
    return (angle_rad + math.pi) % math.tau - math.pi


def frd_to_ned(forward: float, right: float, yaw_rad: float) -> Vector2:
    """Horizontal body vector to (north, east)."""
    cos_yaw, sin_yaw = math.cos(yaw_rad), math.sin(yaw_rad)
    return forward * cos_yaw - right * sin_yaw, forward * sin_yaw + right * cos_yaw


def ned_to_frd(north: float, east: float, yaw_rad: float) -> Vector2:
    """Horizontal (north, east) vector to body (forward, right)."""
    return frd_to_ned(north, east, -yaw_rad)


def moved(ne_m: Vector2, body_m: Vector2, yaw_rad: float) -> Vector2:
    """A position (north, east) after a motion (forward, right) at a heading."""
    north_m, east_m = frd_to_ned(*body_m, yaw_rad)
    return ne_m[0] + north_m, ne_m[1] + east_m


def segment_distance_m(place: Vector2, start: Vector2, end: Vector2) -> float:
    """Distance from a place to the nearest point of a segment, m."""
    north_m, east_m = end[0] - start[0], end[1] - start[1]
    off_m = (place[0] - start[0]) * north_m + (place[1] - start[1]) * east_m
    share = min(max(off_m / max(north_m**2 + east_m**2, 1e-12), 0.0), 1.0)
    return math.dist(place, (start[0] + share * north_m, start[1] + share * east_m))


def along(origin_ne_m: Vector2, bearing_rad: float, range_m: float) -> Vector2:
    """The end (north, east) of a beam."""
    return (
        origin_ne_m[0] + range_m * math.cos(bearing_rad),
        origin_ne_m[1] + range_m * math.sin(bearing_rad),
    )


def points_to_frd(points_ne_m: Array, yaw_rad: float) -> Array:
    """Horizontal vectors (n, 2), north and east, to forward and right."""
    cos_yaw, sin_yaw = math.cos(yaw_rad), math.sin(yaw_rad)
    points_frd_m: Array = points_ne_m @ np.array([[cos_yaw, -sin_yaw], [sin_yaw, cos_yaw]])
    return points_frd_m


def inverse_starts(starts: Array) -> Array:
    """(h, 3): the other frame in each of the frames that begin at starts (h, 3)."""
    cos, sin = np.cos(starts[:, HEADING]), np.sin(starts[:, HEADING])
    north, east = starts[:, 0], starts[:, 1]
    return np.column_stack(
        [-cos * north - sin * east, sin * north - cos * east, -starts[:, HEADING]]
    )


def places_moved_to(start: Array, places: Array) -> Array:
    """Places (n, 2) of a frame, in the frame in which it begins at `start` (3,)."""
    forward, right = places.T
    cos, sin = np.cos(start[HEADING]), np.sin(start[HEADING])
    turned: Array = np.column_stack([cos * forward - sin * right, sin * forward + cos * right])
    return start[:HEADING] + turned


def poses_moved_to(start: Array, poses: Array) -> Array:
    """Poses (n, 3) of a frame, in the frame in which it begins at `start` (3,)."""
    return np.column_stack(
        [places_moved_to(start, poses[:, :HEADING]), poses[:, HEADING] + start[HEADING]]
    )


def to_nearest_m(points: Array, others: Array) -> Array:
    """Distance of each point (n, 2) to the nearest of others (m, 2), (n,), m; infinite without."""
    first, second = (points[:, None, axis] - others[:, axis] for axis in (0, 1))
    squares: Array = (first * first + second * second).min(axis=1, initial=math.inf)
    return np.sqrt(squares)


def ned_to_enu(vector_ned: Vector3) -> Vector3:
    """NED vector to ENU; its own inverse."""
    north, east, down = vector_ned
    return east, north, -down


def yaw_ned_to_enu(yaw_rad: float) -> float:
    """Clockwise from north to anticlockwise from east, in [-π, π); its own inverse."""
    return wrap_rad(math.pi / 2 - yaw_rad)


def ned_to_gltf(vector_ned: Vector3) -> Vector3:
    """NED vector to glTF's axes: x east, y up, z south."""
    north, east, down = vector_ned
    return east, -down, -north


EARTH_RADIUS_M = 6_378_137.0
EARTH_ECCENTRICITY_2 = 6.694_379_990_141e-3
"""Semi-major axis, m, and squared eccentricity of WGS 84."""


@dataclass(frozen=True, slots=True)
class Place:
    """Position of the local frame's origin on Earth, WGS 84, and direction of its x axis."""

    lat_deg: float
    lon_deg: float
    heading_rad: float = 0.0
    """Clockwise from true north."""

    def lon_lat_deg(self, north: float, east: float) -> Vector2:
        """Local NED (north, east) to longitude and latitude.

        Uses the ellipsoid's tangent plane at the origin and its radii of curvature; exact to a
        millimetre within 100 m.
        """
        true_north_m, true_east_m = frd_to_ned(north, east, self.heading_rad)
        lat_rad = math.radians(self.lat_deg)
        flattened = 1 - EARTH_ECCENTRICITY_2 * math.sin(lat_rad) ** 2
        meridian_m = EARTH_RADIUS_M * (1 - EARTH_ECCENTRICITY_2) / flattened**1.5
        parallel_m = EARTH_RADIUS_M / math.sqrt(flattened) * math.cos(lat_rad)
        return (
            self.lon_deg + math.degrees(true_east_m / parallel_m),
            self.lat_deg + math.degrees(true_north_m / meridian_m),
        )

"""Frames, and every conversion between them.

Two frames live inside the program, both right-handed with z down:

- **local NED**: origin where the drone took off; x along its first heading ("north"),
  y to the right of it ("east"), z down. Yaw is clockwise seen from above, zero at the start.
- **body FRD**: x forward, y right, z down.

Recordings and exports follow their readers' habits: ENU (x east, y north, z up) and body FLU
(x forward, y left, z up) as ROS, PLY and DXF have them, y up as glTF has it, or degrees on Earth.
"""

import math

Vector2 = tuple[float, float]
Vector3 = tuple[float, float, float]


def wrap_rad(angle_rad: float) -> float:
    """The same direction in [-π, π)."""
    return (angle_rad + math.pi) % math.tau - math.pi


def frd_to_ned(forward: float, right: float, yaw_rad: float) -> Vector2:
    """Horizontal body vector to (north, east)."""
    cos_yaw, sin_yaw = math.cos(yaw_rad), math.sin(yaw_rad)
    return forward * cos_yaw - right * sin_yaw, forward * sin_yaw + right * cos_yaw


def ned_to_frd(north: float, east: float, yaw_rad: float) -> Vector2:
    """Horizontal (north, east) vector to body (forward, right)."""
    return frd_to_ned(north, east, -yaw_rad)


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

"""The few control laws that all manoeuvres share. Velocities m/s, angles rad, body FRD."""

import math

from companion.core.frames import Vector2, ned_to_frd, wrap_rad
from companion.core.messages import Pose, Setpoint

TURN_GAIN_1_S = 2.0
HEIGHT_GAIN_1_S = 0.8
MAX_CLIMB_M_S = 0.4
DISTANCE_GAIN_1_S = 0.7
TRIM_GAIN_1_S = 0.8
CLOSE_M = 0.4
"""Within this of a place the drone trims its position without turning."""
MAX_SIDE_M_S = 0.3
"""The drone trims its place without turning."""
CLIMB_LAG_S = 0.45
"""The drone climbs on for so long at the speed that it has (docs/autopilot.md)."""
FULL_STOP_BEFORE_M = 0.7
"""Nearer than this to anything ahead the drone does not move on, whatever the phase."""
BRAKING_M_S2 = 0.5
"""Gentle enough for the autopilot's velocity loop, which needs about a second, to follow."""


def clamp(value: float, limit: float) -> float:
    """`value` within ±limit."""
    return max(-limit, min(limit, value))


def turn_towards(heading_rad: float, yaw_rad: float, most_rad_s: float) -> float:
    """Yaw rate that brings the nose to `heading_rad` the short way round."""
    return clamp(TURN_GAIN_1_S * wrap_rad(heading_rad - yaw_rad), most_rad_s)


def climb_to(height_m: float, present_m: float) -> float:
    """Down velocity that brings the drone to `height_m`."""
    return clamp(HEIGHT_GAIN_1_S * (present_m - height_m), MAX_CLIMB_M_S)


def keep_distance(present_m: float, wanted_m: float, most_m_s: float) -> float:
    """Velocity towards a wall that holds the stand-off; negative backs away."""
    return clamp(DISTANCE_GAIN_1_S * (present_m - wanted_m), most_m_s)


def approach_speed(room_m: float, most_m_s: float, lag_s: float) -> float:
    """The speed from which the drone can still stop within `room_m`.

    It goes on for the lag, then brakes: v·lag + v² / (2·a) = room.
    """
    root = math.sqrt(lag_s**2 + 2 * max(room_m, 0.0) / BRAKING_M_S2)
    return min(most_m_s, BRAKING_M_S2 * (root - lag_s))


def glide(place_ne_m: Vector2, pose: Pose, most_m_s: float, lag_s: float) -> Setpoint:
    """Straight to a place nearby, whatever way the nose points, and stay there."""
    here = pose.ne_m
    distance_m = math.dist(here, place_ne_m)
    if distance_m < CLOSE_M:
        return stay(place_ne_m, pose)
    speed_m_s = approach_speed(distance_m, most_m_s, lag_s) / distance_m
    forward_m, right_m = ned_to_frd(place_ne_m[0] - here[0], place_ne_m[1] - here[1], pose.yaw_rad)
    return Setpoint(speed_m_s * forward_m, speed_m_s * right_m)


def stay(place_ne_m: Vector2, pose: Pose) -> Setpoint:
    """Hold a place against drift and gusts."""
    forward_m, right_m = ned_to_frd(
        place_ne_m[0] - pose.north_m, place_ne_m[1] - pose.east_m, pose.yaw_rad
    )
    return Setpoint(
        clamp(TRIM_GAIN_1_S * forward_m, MAX_SIDE_M_S),
        clamp(TRIM_GAIN_1_S * right_m, MAX_SIDE_M_S),
    )

"""Computes velocity and yaw-rate setpoints: the control laws that all manoeuvres share.

Velocities are in m/s, angles in rad, vectors in the body frame (FRD).
"""

import math

from companion.core.frames import Vector2, ned_to_frd, wrap_rad
from companion.core.messages import Pose, Setpoint

TURN_GAIN_1_S = 2.0
"""Yaw rate per heading error, 1/s. Chosen."""
HEIGHT_GAIN_1_S = 0.8
"""Vertical speed per height error, 1/s. Chosen."""
MAX_CLIMB_M_S = 0.4
"""Maximum vertical speed, up or down, m/s. Chosen."""
DISTANCE_GAIN_1_S = 0.7
"""Speed per error of the distance to a wall, 1/s. Chosen."""
TRIM_GAIN_1_S = 0.8
"""Speed per position error within `CLOSE_M`, 1/s. Chosen."""
CLOSE_M = 0.4
"""Within this distance of a target the drone corrects its position proportionally, m. Chosen."""
MAX_SIDE_M_S = 0.3
"""Maximum speed, per axis, of a position correction without a turn, m/s. Chosen."""
CLIMB_LAG_S = 0.45
"""Time for which the drone keeps its vertical speed after a change, s (docs/autopilot.md)."""
FULL_STOP_BEFORE_M = 0.7
"""Minimum distance to an obstacle ahead, m; below it the drone stops in every phase. Chosen."""
BODY_RADIUS_M = 0.2
"""Distance from the drone's centre to its hull, m; half the width of the swept path."""
BRAKING_M_S2 = 0.5
"""Planned deceleration, m/s². Chosen: the autopilot's velocity loop, which needs about a second,
can follow it."""


def clamp(value: float, limit: float) -> float:
    """Limit `value` to ±`limit`."""
    return max(-limit, min(limit, value))


def turn_towards(heading_rad: float, yaw_rad: float, most_rad_s: float) -> float:
    """Return the yaw rate, rad/s, that turns the nose to `heading_rad` by the shorter way."""
    return clamp(TURN_GAIN_1_S * wrap_rad(heading_rad - yaw_rad), most_rad_s)


def climb_to(height_m: float, present_m: float) -> float:
    """Return the down velocity, m/s, that brings the drone to `height_m`."""
    return clamp(HEIGHT_GAIN_1_S * (present_m - height_m), MAX_CLIMB_M_S)


def keep_distance(present_m: float, wanted_m: float, most_m_s: float) -> float:
    """Return the velocity towards a wall, m/s, that holds the stand-off; negative is away."""
    return clamp(DISTANCE_GAIN_1_S * (present_m - wanted_m), most_m_s)


def approach_speed(room_m: float, most_m_s: float, lag_s: float) -> float:
    """Return the highest speed, m/s, from which the drone can stop within `room_m`.

    The drone keeps its speed for the lag, then brakes: v·lag + v² / (2·a) = room.
    """
    root = math.sqrt(lag_s**2 + 2 * max(room_m, 0.0) / BRAKING_M_S2)
    return min(most_m_s, BRAKING_M_S2 * (root - lag_s))


def stopping_m(speed_m_s: float, lag_s: float) -> float:
    """Return the distance, m, in which the drone stops: the inverse of `approach_speed`."""
    return speed_m_s * lag_s + speed_m_s**2 / (2 * BRAKING_M_S2)


def glide(place_ne_m: Vector2, pose: Pose, most_m_s: float, lag_s: float) -> Setpoint:
    """Fly straight to a nearby position at any heading, and hold it."""
    here = pose.ne_m
    distance_m = math.dist(here, place_ne_m)
    if distance_m < CLOSE_M:
        return stay(place_ne_m, pose)
    speed_m_s = approach_speed(distance_m, most_m_s, lag_s) / distance_m
    forward_m, right_m = ned_to_frd(place_ne_m[0] - here[0], place_ne_m[1] - here[1], pose.yaw_rad)
    return Setpoint(speed_m_s * forward_m, speed_m_s * right_m)


def stay(place_ne_m: Vector2, pose: Pose) -> Setpoint:
    """Hold a position against drift and gusts."""
    forward_m, right_m = ned_to_frd(
        place_ne_m[0] - pose.north_m, place_ne_m[1] - pose.east_m, pose.yaw_rad
    )
    return Setpoint(
        clamp(TRIM_GAIN_1_S * forward_m, MAX_SIDE_M_S),
        clamp(TRIM_GAIN_1_S * right_m, MAX_SIDE_M_S),
    )

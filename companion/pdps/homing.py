"""Back to where the flight began, nose first, so that the front beam looks where the drone goes."""

import math

from companion.config import MissionConfig
from companion.frames import Vector2, ned_to_frd, wrap_rad
from companion.messages import Beam, Setpoint
from companion.pdps.control import approach_speed, clamp, climb_to, turn_towards
from companion.pdps.room_scan import FULL_STOP_BEFORE_M, Sight

ARRIVED_M = 0.10
CLOSE_M = 0.4
"""Within this the drone trims its position without turning: it hovers in space it came through."""
NOSE_ON_RAD = math.radians(15)
TRIM_GAIN_1_S = 0.8


def arrived(sight: Sight, home_ne_m: Vector2) -> bool:
    """The drone is over its goal."""
    return math.dist((sight.pose.north_m, sight.pose.east_m), home_ne_m) < ARRIVED_M


def step(sight: Sight, home_ne_m: Vector2, plan: MissionConfig) -> Setpoint:
    """The velocity that brings the drone home along a straight line."""
    north_m = home_ne_m[0] - sight.pose.north_m
    east_m = home_ne_m[1] - sight.pose.east_m
    distance_m = math.hypot(north_m, east_m)
    down_m_s = climb_to(plan.height_m, sight.pose.height_m)
    if distance_m < CLOSE_M:
        forward, right = ned_to_frd(north_m, east_m, sight.pose.yaw_rad)
        return Setpoint(
            clamp(TRIM_GAIN_1_S * forward, 0.3), clamp(TRIM_GAIN_1_S * right, 0.3), down_m_s
        )
    bearing_rad = math.atan2(east_m, north_m)
    most_rad_s = math.radians(plan.turn_rate_deg_s)
    yaw_rate_rad_s = turn_towards(bearing_rad, sight.pose.yaw_rad, most_rad_s)
    if abs(wrap_rad(bearing_rad - sight.pose.yaw_rad)) > NOSE_ON_RAD:
        return Setpoint(down_m_s=down_m_s, yaw_rate_rad_s=yaw_rate_rad_s)
    room_m = min(sight.clear_m(Beam.FRONT) - FULL_STOP_BEFORE_M, distance_m)
    return Setpoint(
        approach_speed(room_m, plan.speed_m_s), down_m_s=down_m_s, yaw_rate_rad_s=yaw_rate_rad_s
    )

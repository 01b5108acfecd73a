"""Encodes a vehicle's true state as a simulated autopilot sends it.

The message is SIM_STATE or HIL_STATE_QUATERNION. Only an autopilot that simulates its own flight
sends it (`sitl autopilot`). Only the simulator that provides its world reads it, never a companion.
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import Vector3
from sitl.autopilot.streams import Message
from sitl.core.truth import TrueState

EARTH_M_DEG = 111_319.49
"""One degree of latitude, or of longitude at the equator, m. ArduPilot's constant."""

Place = tuple[int, int, int]
"""Latitude and longitude, degrees times 1e7; height above sea level, mm."""

SIM_HOME: Place = (-353_632_621, 1_491_652_374, 584_000)
"""Default location of simulated ArduPilots: a model airfield near Canberra."""


def place_at(home: Place, position_ned_m: Vector3) -> Place:
    """The place at an offset from home."""
    north, east, down = position_ned_m
    per_degree_east = EARTH_M_DEG * math.cos(math.radians(home[0] * 1e-7))
    return (
        home[0] + round(1e7 * north / EARTH_M_DEG),
        home[1] + round(1e7 * east / per_degree_east),
        home[2] - round(1e3 * down),
    )


def offset_ned_m(home: Place, place: Place) -> Vector3:
    """The offset of a place from home, m."""
    per_degree_east = EARTH_M_DEG * math.cos(math.radians(home[0] * 1e-7))
    return (
        (place[0] - home[0]) * 1e-7 * EARTH_M_DEG,
        (place[1] - home[1]) * 1e-7 * per_degree_east,
        (home[2] - place[2]) * 1e-3,
    )


def sim_state(truth: TrueState) -> Message:
    """SIM_STATE (108) as ArduPilot sends it: the floats lat and lon are scaled by 1e7 too."""
    lat, lon, alt_mm = place_at(SIM_HOME, truth.position_ned_m)
    return mavlink.MAVLink_sim_state_message(
        *_quaternion_wxyz(truth),
        *(truth.roll_rad, truth.pitch_rad, truth.yaw_rad),
        *(0.0, 0.0, -9.81),
        *(0.0, 0.0, truth.yaw_rate_rad_s),
        *(float(lat), float(lon), alt_mm * 1e-3),
        *(0.0, 0.0),
        *truth.velocity_ned_m_s,
        *(lat, lon),
    )


def hil_state_quaternion(truth: TrueState) -> Message:
    """HIL_STATE_QUATERNION (115) as PX4's simulation in hardware sends it."""
    velocity_cm_s = (_int16(100 * v) for v in truth.velocity_ned_m_s)
    return mavlink.MAVLink_hil_state_quaternion_message(
        round(truth.time_s * 1e6),
        _quaternion_wxyz(truth),
        *(0.0, 0.0, truth.yaw_rate_rad_s),
        *place_at(SIM_HOME, truth.position_ned_m),
        *velocity_cm_s,
        *(0, 0),
        *(0, 0, -1000),
    )


def _int16(value: float) -> int:
    return max(-32768, min(32767, round(value)))


def _quaternion_wxyz(truth: TrueState) -> tuple[float, float, float, float]:
    return quaternion_wxyz(truth.roll_rad, truth.pitch_rad, truth.yaw_rad)


def quaternion_wxyz(
    roll_rad: float, pitch_rad: float, yaw_rad: float
) -> tuple[float, float, float, float]:
    """Quaternion from body to NED, from roll, pitch and yaw in aerospace order."""
    cr, sr = math.cos(roll_rad / 2), math.sin(roll_rad / 2)
    cp, sp = math.cos(pitch_rad / 2), math.sin(pitch_rad / 2)
    cy, sy = math.cos(yaw_rad / 2), math.sin(yaw_rad / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )

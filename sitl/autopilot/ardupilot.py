"""What is particular to ArduCopter 4.6.3: numbers, answers and texts, as measured on a running one.

The core decides what happens; this file says how ArduCopter calls it.
"""

import math
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.frames import Vector3, frd_to_ned

AUTOPILOT = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
CAPABILITIES = 64495
FLIGHT_SW_VERSION = 67502976

STABILIZE, ALT_HOLD, AUTO, GUIDED, LOITER, RTL, LAND = 0, 2, 3, 4, 5, 6, 9
POSHOLD, BRAKE, GUIDED_NOGPS = 16, 17, 20
MODES = frozenset(
    {STABILIZE, ALT_HOLD, AUTO, GUIDED, LOITER, RTL, LAND, POSHOLD, BRAKE, GUIDED_NOGPS}
)

BASE_MODE_IDLE = 81
BASE_MODE_GUIDED_BIT = 8
"""89 in GUIDED, 217 in GUIDED and armed."""

EKF_READY = 895
EKF_WITHOUT_POSITION = 167

TEXT_LENGTH = 50

PARAMETERS: dict[str, tuple[float, int]] = {
    "ARMING_CHECK": (1, mavlink.MAV_PARAM_TYPE_INT32),
    "AVOID_BEHAVE": (0, mavlink.MAV_PARAM_TYPE_INT8),
    "AVOID_ENABLE": (3, mavlink.MAV_PARAM_TYPE_INT8),
    "AVOID_MARGIN": (2.0, mavlink.MAV_PARAM_TYPE_REAL32),
    "EK3_SRC1_POSXY": (6, mavlink.MAV_PARAM_TYPE_INT8),
    "EK3_SRC1_VELXY": (6, mavlink.MAV_PARAM_TYPE_INT8),
    "EK3_SRC1_YAW": (1, mavlink.MAV_PARAM_TYPE_INT8),
    "FS_THR_ENABLE": (0, mavlink.MAV_PARAM_TYPE_INT8),
    "GPS1_TYPE": (0, mavlink.MAV_PARAM_TYPE_INT8),
    "GUID_TIMEOUT": (3.0, mavlink.MAV_PARAM_TYPE_REAL32),
    "PRX1_TYPE": (2, mavlink.MAV_PARAM_TYPE_INT8),
    "RNGFND1_ORIENT": (25, mavlink.MAV_PARAM_TYPE_INT8),
    "RNGFND1_TYPE": (10, mavlink.MAV_PARAM_TYPE_INT8),
    "SYSID_THISMAV": (1, mavlink.MAV_PARAM_TYPE_INT16),
    "VISO_TYPE": (1, mavlink.MAV_PARAM_TYPE_INT8),
    "WP_YAW_BEHAVIOR": (2, mavlink.MAV_PARAM_TYPE_INT8),
}
LEAST_GUID_TIMEOUT_S = 0.1

IGNORE_POSITION = 0x0007
IGNORE_VELOCITY = 0x0038
IGNORE_ACCELERATION = 0x01C0
FORCE = 0x0200
IGNORE_YAW = 0x0400
IGNORE_YAW_RATE = 0x0800
MOST_VELOCITY_M_S = 1000.0


@dataclass(frozen=True, slots=True)
class VelocityTarget:
    """An accepted velocity setpoint, in the autopilot's estimated NED."""

    velocity_ned_m_s: Vector3
    yaw_rate_rad_s: float


def velocity_target(message: object, yaw_rad: float) -> VelocityTarget | None:
    """What SET_POSITION_TARGET_LOCAL_NED (84) asks for; None stops the vehicle, without a word.

    Frames 1 and 7 are NED; 8 and 9 are turned by the heading. Any other frame, a forced or empty
    mask, one ignored velocity axis, NaN or absurd values restart GUIDED, which stops.
    """
    m = message
    mask, frame = m.type_mask, m.coordinate_frame  # type: ignore[attr-defined]
    velocity = (m.vx, m.vy, m.vz)  # type: ignore[attr-defined]
    turned = frame in (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED)
    known = turned or frame in (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_OFFSET_NED)
    if not known or mask & (FORCE | IGNORE_VELOCITY):
        return None
    if not all(math.isfinite(v) and abs(v) <= MOST_VELOCITY_M_S for v in velocity):
        return None
    if turned:
        velocity = (*frd_to_ned(velocity[0], velocity[1], yaw_rad), velocity[2])
    yaw_rate = 0.0 if mask & IGNORE_YAW_RATE else m.yaw_rate  # type: ignore[attr-defined]
    if not math.isfinite(yaw_rate):
        return None
    return VelocityTarget(velocity, yaw_rate)

"""PX4 1.17: as read in its source."""

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.frames import Vector3, frd_to_ned
from sitl.autopilot.parameters.protocol import Parameters
from sitl.autopilot.parameters.px4 import Px4Parameters
from sitl.autopilot.parameters.table import load_table
from sitl.autopilot.personality import Behaviour, Refusal, VelocityTarget
from sitl.autopilot.streams import Message


def custom_mode(main: int, sub: int = 0) -> int:
    """HEARTBEAT.custom_mode: the main mode in the third byte, the sub-mode in the fourth."""
    return main << 16 | sub << 24


MANUAL, ALTCTL, POSCTL, OFFBOARD = (custom_mode(main) for main in (1, 2, 3, 6))
AUTO_TAKEOFF, AUTO_LOITER, AUTO_RTL, AUTO_LAND = (custom_mode(4, sub) for sub in (2, 3, 5, 6))
BEHAVIOUR = {
    **dict.fromkeys((MANUAL, ALTCTL, POSCTL, AUTO_LOITER, AUTO_RTL), Behaviour.HOLD),
    OFFBOARD: Behaviour.OFFBOARD,
    AUTO_TAKEOFF: Behaviour.TAKE_OFF,
    AUTO_LAND: Behaviour.LAND,
}
OFFBOARD_LOSS_MODES = {0: POSCTL, 1: ALTCTL, 2: MANUAL, 3: AUTO_RTL, 4: AUTO_LAND, 5: AUTO_LOITER}
"""By COM_OBL_RC_ACT."""

BASE_MODE_IDLE: int = (
    mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
)
BASE_MODE_AUTO: int = mavlink.MAV_MODE_FLAG_AUTO_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED

ARMED: int = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
READY = (
    mavlink.ESTIMATOR_ATTITUDE
    | mavlink.ESTIMATOR_VELOCITY_HORIZ
    | mavlink.ESTIMATOR_VELOCITY_VERT
    | mavlink.ESTIMATOR_POS_HORIZ_REL
    | mavlink.ESTIMATOR_POS_VERT_ABS
)
WITHOUT_POSITION = mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_CONST_POS_MODE

IGNORE_VELOCITY = 0x0038
IGNORE_YAW_RATE = 0x0800
IGNORE_ALL = 0x0DFF

CONFIGURED: dict[str, float] = {
    "CA_ROTOR_COUNT": 4,
    "EKF2_GPS_CTRL": 0,
    "EKF2_HGT_REF": 2,
    "SYS_AUTOSTART": 4001,
    "SYS_HAS_GPS": 0,
}
"""A quadcopter without GPS, its height from a range sensor."""


class Px4:
    """The multicopter."""

    autopilot: int = mavlink.MAV_AUTOPILOT_PX4
    boot_mode = AUTO_LOITER
    land_mode = AUTO_LAND
    take_off_mode: int | None = AUTO_TAKEOFF
    hold_mode = AUTO_LOITER
    refused: int = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    configured = CONFIGURED
    parameter_protocol: type[Parameters] = Px4Parameters
    system_id_parameter = "MAV_SYS_ID"
    setpoints_before_offboard = True
    lifts_off_by_setpoint = True
    capabilities: int = (
        mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    flight_sw_version = 0x01_11_00_40

    def __init__(self) -> None:
        self.streams_hz: dict[int, float] = {
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 30.0,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: 100.0,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
            mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 1.0,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
        }
        self.table = load_table("px4")

    def behaviour(self, mode: int) -> Behaviour | None:
        return BEHAVIOUR.get(mode)

    def mode_of(self, main: int, sub: int) -> int:
        return custom_mode(main, sub)

    def base_mode(self, mode: int, *, armed: bool) -> int:
        automatic = BASE_MODE_AUTO if mode >> 16 & 0xFF in (4, 6) else 0
        return BASE_MODE_IDLE | automatic | (ARMED if armed else 0)

    def no_such_mode(self, mode: int) -> str:
        return ""

    def setpoint(
        self, message: Message, yaw_rad: float, parameters: dict[str, float]
    ) -> VelocityTarget | Refusal:
        """Only frames 1 and 8; one ignored velocity axis ignores all."""
        m: Any = message
        turned = m.coordinate_frame == mavlink.MAV_FRAME_BODY_NED
        if not turned and m.coordinate_frame != mavlink.MAV_FRAME_LOCAL_NED:
            frame = m.coordinate_frame
            return Refusal(f"coordinate frame {frame} unsupported")
        if m.type_mask & IGNORE_ALL == IGNORE_ALL or m.type_mask & IGNORE_VELOCITY:
            return Refusal("SET_POSITION_TARGET_LOCAL_NED invalid")
        yaw_rate = 0.0 if m.type_mask & IGNORE_YAW_RATE else m.yaw_rate
        if not all(map(math.isfinite, (m.vx, m.vy, m.vz, yaw_rate))):
            return Refusal("SET_POSITION_TARGET_LOCAL_NED invalid")
        vx, vy, vz = _cut((m.vx, m.vy, m.vz), parameters)
        north, east = frd_to_ned(vx, vy, yaw_rad) if turned else (vx, vy)
        return VelocityTarget((north, east, vz), yaw_rate)

    def setpoint_loss(self, parameters: dict[str, float]) -> tuple[float, int | None]:
        action = int(parameters["COM_OBL_RC_ACT"])
        return parameters["COM_OF_LOSS_T"], OFFBOARD_LOSS_MODES.get(action, AUTO_LOITER)

    def take_off_height_m(self, asked_m: float, parameters: dict[str, float]) -> float:
        """The command's altitude is above the sea, which nobody knows indoors."""
        return parameters["MIS_TAKEOFF_ALT"]

    def estimator_status(self, boot_us: int, *, has_position: bool) -> Message:
        """ESTIMATOR_STATUS (230)."""
        flags = READY if has_position else WITHOUT_POSITION
        return mavlink.MAVLink_estimator_status_message(
            boot_us, flags, *(0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.05, 0.05)
        )


def _cut(velocity: Vector3, parameters: dict[str, float]) -> Vector3:
    """What is faster than MPC_XY_VEL_MAX and MPC_Z_VEL_MAX_UP and _DN allow is slowed down."""
    vx, vy, vz = velocity
    speed = math.hypot(vx, vy)
    most = max(0.0, parameters["MPC_XY_VEL_MAX"])
    share = most / speed if speed > most else 1.0
    up, down = parameters["MPC_Z_VEL_MAX_UP"], parameters["MPC_Z_VEL_MAX_DN"]
    return vx * share, vy * share, max(-up, min(down, vz))

"""ArduCopter 4.6.3: numbers, answers and texts as measured on a running one."""

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.frames import frd_to_ned
from sitl.autopilot.parameters.ardupilot import ArduPilotParameters
from sitl.autopilot.parameters.protocol import Parameters
from sitl.autopilot.parameters.table import load_table
from sitl.autopilot.personality import Behaviour, Refusal, VelocityTarget
from sitl.autopilot.streams import Message

STABILIZE, ALT_HOLD, AUTO, GUIDED, LOITER, RTL, LAND = 0, 2, 3, 4, 5, 6, 9
POSHOLD, BRAKE, GUIDED_NOGPS = 16, 17, 20
BEHAVIOUR = {
    **dict.fromkeys((STABILIZE, ALT_HOLD, AUTO, LOITER, RTL, POSHOLD, BRAKE), Behaviour.HOLD),
    GUIDED: Behaviour.OFFBOARD,
    GUIDED_NOGPS: Behaviour.OFFBOARD,
    LAND: Behaviour.LAND,
}

BASE_MODE_IDLE = 81
BASE_MODE_GUIDED_BIT = 8
"""89 in GUIDED, 217 in GUIDED and armed."""
EKF_READY = 895
EKF_WITHOUT_POSITION = 167

FORCE = 0x0200
IGNORE_VELOCITY = 0x0038
IGNORE_YAW_RATE = 0x0800
MOST_VELOCITY_M_S = 1000.0
LEAST_GUID_TIMEOUT_S = 0.1
TURNED_FRAMES = (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED)
NED_FRAMES = (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_OFFSET_NED)
STOP = Refusal(stops=True)

CONFIGURED: dict[str, float] = {
    "BATT_MONITOR": 4,
    "EK3_SRC1_POSXY": 6,
    "EK3_SRC1_VELXY": 6,
    "EK3_SRC1_VELZ": 6,
    "FRAME_CLASS": 1,
    "FS_THR_ENABLE": 0,
    "GPS1_TYPE": 0,
    "PRX1_TYPE": 2,
    "RNGFND1_TYPE": 10,
    "VISO_TYPE": 1,
}
"""Position from an external estimator, ranges over MAVLink, neither GPS nor a remote control."""


class ArduPilot:
    """The copter."""

    autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    boot_mode = STABILIZE
    land_mode = LAND
    take_off_mode: int | None = None
    hold_mode = LOITER
    refused: int = mavlink.MAV_RESULT_FAILED
    configured = CONFIGURED
    parameter_protocol: type[Parameters] = ArduPilotParameters
    system_id_parameter = "SYSID_THISMAV"
    setpoints_before_offboard = False
    lifts_off_by_setpoint = False
    capabilities = 64495
    flight_sw_version = 67502976

    def __init__(self) -> None:
        self.streams_hz: dict[int, float] = {}
        self.table = load_table("ardupilot")

    def behaviour(self, mode: int) -> Behaviour | None:
        return BEHAVIOUR.get(mode)

    def mode_of(self, main: int, sub: int) -> int:
        return main

    def base_mode(self, mode: int, *, armed: bool) -> int:
        guided = BASE_MODE_GUIDED_BIT if BEHAVIOUR.get(mode) is Behaviour.OFFBOARD else 0
        return BASE_MODE_IDLE | guided | (mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)

    def no_such_mode(self, mode: int) -> str:
        return f"No such mode {mode}"

    def setpoint(
        self, message: Message, yaw_rad: float, parameters: dict[str, float]
    ) -> VelocityTarget | Refusal:
        """Frames 1 and 7 are NED; 8 and 9 are turned by the heading.

        Any other frame, a forced or empty mask, one ignored velocity axis, NaN or absurd values
        restart GUIDED, which stops.
        """
        m: Any = message
        turned = m.coordinate_frame in TURNED_FRAMES
        if not turned and m.coordinate_frame not in NED_FRAMES:
            return STOP
        if m.type_mask & (FORCE | IGNORE_VELOCITY):
            return STOP
        yaw_rate = 0.0 if m.type_mask & IGNORE_YAW_RATE else m.yaw_rate
        numbers = (m.vx, m.vy, m.vz, yaw_rate)
        if not all(math.isfinite(v) and abs(v) <= MOST_VELOCITY_M_S for v in numbers):
            return STOP
        north, east = frd_to_ned(m.vx, m.vy, yaw_rad) if turned else (m.vx, m.vy)
        return VelocityTarget((north, east, m.vz), yaw_rate)

    def setpoint_loss(self, parameters: dict[str, float]) -> tuple[float, int | None]:
        return max(parameters["GUID_TIMEOUT"], LEAST_GUID_TIMEOUT_S), None

    def take_off_height_m(self, asked_m: float, parameters: dict[str, float]) -> float:
        return asked_m

    def estimator_status(self, boot_us: int, *, has_position: bool) -> Message:
        """EKF_STATUS_REPORT (193)."""
        flags = EKF_READY if has_position else EKF_WITHOUT_POSITION
        return mavlink.MAVLink_ekf_status_report_message(flags, 0.1, 0.1, 0.1, 0.1, 0.0)

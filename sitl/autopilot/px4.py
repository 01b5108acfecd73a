"""Emulates PX4 1.17 from its source."""

import math
from collections.abc import Callable
from copy import copy
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import Vector3, frd_to_ned
from sitl.autopilot.estimation.external_messages import ExternalMessages, ExternalPoseMessages
from sitl.autopilot.estimation.ground_truth import Place, hil_state_quaternion
from sitl.autopilot.estimation.px4_estimate import estimator_flags
from sitl.autopilot.firmware import (
    Behaviour,
    Condition,
    EstimatorHealth,
    Failsafe,
    ParameterValues,
    PositionTarget,
    Refusal,
    Sources,
    Target,
    VelocityTarget,
)
from sitl.autopilot.messages import TextHabit
from sitl.autopilot.parameters.protocol import Parameters
from sitl.autopilot.parameters.px4 import Px4Parameters
from sitl.autopilot.parameters.table import load_table
from sitl.autopilot.response import PX4, Response
from sitl.autopilot.streams import Message
from sitl.core.truth import TrueState


def custom_mode(main: int, sub: int = 0) -> int:
    """HEARTBEAT.custom_mode: the main mode in the third byte, the sub-mode in the fourth."""
    return main << 16 | sub << 24


MANUAL, ALTCTL, POSCTL, OFFBOARD, STABILIZED = (custom_mode(main) for main in (1, 2, 3, 6, 7))
AUTO_TAKEOFF, AUTO_LOITER, AUTO_RTL, AUTO_LAND = (custom_mode(4, sub) for sub in (2, 3, 5, 6))
"""custom_mode numbers of PX4. The automatic modes are sub-modes of main mode 4."""
BEHAVIOUR = {
    **dict.fromkeys((AUTO_LOITER, AUTO_RTL), Behaviour.HOLD),
    **dict.fromkeys((ALTCTL, POSCTL), Behaviour.CLIMB_BY_STICK),
    **dict.fromkeys((MANUAL, STABILIZED), Behaviour.THRUST_BY_STICK),
    OFFBOARD: Behaviour.OFFBOARD,
    AUTO_TAKEOFF: Behaviour.TAKE_OFF,
    AUTO_LAND: Behaviour.LAND,
}
OFFBOARD_LOSS_MODES = {0: POSCTL, 1: ALTCTL, 2: MANUAL, 3: AUTO_RTL, 4: AUTO_LAND, 5: AUTO_LOITER}
"""Mode after a setpoint timeout, by COM_OBL_RC_ACT."""

BASE_MODE: int = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
BASE_MODE_OF: dict[int, int] = {
    **dict.fromkeys((1, 2, 3, 7), mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED),
    4: mavlink.MAV_MODE_FLAG_AUTO_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED,
}
"""Bits of HEARTBEAT.base_mode by main mode."""
ARMED: int = mavlink.MAV_MODE_FLAG_SAFETY_ARMED

IGNORE_POSITION, IGNORE_VELOCITY = 0x0007, 0x0038
"""Bits of SET_POSITION_TARGET_LOCAL_NED.type_mask; also those below."""
IGNORE_YAW, IGNORE_YAW_RATE = 0x0400, 0x0800
"""Bits that exclude heading and yaw rate."""
INVALID = Refusal("SET_POSITION_TARGET_LOCAL_NED invalid")
POSE_MESSAGES = ExternalPoseMessages(
    (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_FRD),
    (
        mavlink.MAV_ESTIMATOR_TYPE_UNKNOWN,
        mavlink.MAV_ESTIMATOR_TYPE_NAIVE,
        mavlink.MAV_ESTIMATOR_TYPE_VISION,
        mavlink.MAV_ESTIMATOR_TYPE_VIO,
    ),
    takes_vision_speed=False,
)
"""PX4 has had no handler for VISION_SPEED_ESTIMATE (103) since 1.16."""
VISION_POSITION_BIT, VISION_VELOCITY_BIT, VISION_YAW_BIT = 1, 4, 8
"""Bits of EKF2_EV_CTRL."""
OFFBOARD_LOSS_DELAY_S = 0.1
"""Delay of leaving OFFBOARD after COM_OF_LOSS_T, s. Measured."""
NO_AID_S = 5.0
"""EKF2_NOAID_TOUT: without any aiding the position becomes invalid, s."""

CONFIGURED: dict[str, float] = {
    "CA_ROTOR_COUNT": 4,
    "EKF2_GPS_CTRL": 0,
    "EKF2_HGT_REF": 2,
    "SYS_AUTOSTART": 4001,
    "SYS_HAS_GPS": 0,
}
"""A quadcopter without GPS; its height comes from a range sensor."""


def _battery_below(parameter: str) -> Callable[[Condition, ParameterValues], bool]:
    return lambda condition, parameters: condition.battery < parameters[parameter]


def _battery_mode(landing_actions: tuple[int, ...]) -> Callable[[ParameterValues], int | None]:
    """COM_LOW_BAT_ACT: 0 warns, 2 lands at critical, 3 returns at critical, lands at emergency."""
    return lambda parameters: (
        AUTO_LAND if parameters["COM_LOW_BAT_ACT"] in landing_actions else None
    )


def _lost(age_s: float, timeout_s: float) -> bool:
    return math.isfinite(age_s) and age_s > timeout_s


FAILSAFES = (
    Failsafe(
        lambda condition, _: condition.unaided_s > NO_AID_S,
        ("Position estimate lost", "Failsafe activated: landing"),
        "Position estimate regained",
        lambda _: AUTO_LAND,
    ),
    Failsafe(_battery_below("BAT_LOW_THR"), ("Low battery level",)),
    Failsafe(
        _battery_below("BAT_CRIT_THR"),
        ("Critical battery level",),
        mode=_battery_mode((2, 3)),
    ),
    Failsafe(
        _battery_below("BAT_EMERGEN_THR"),
        ("Emergency battery level",),
        mode=_battery_mode((2, 3)),
    ),
    Failsafe(
        lambda condition, parameters: (
            parameters["NAV_DLL_ACT"] > 0
            and _lost(condition.ground_station_age_s, parameters["COM_DL_LOSS_T"])
        ),
        ("Connection to ground control lost",),
        "Ground control regained",
        lambda _: AUTO_LAND,
    ),
    Failsafe(
        lambda condition, parameters: _lost(
            condition.onboard_computer_age_s, parameters["COM_OBC_LOSS_T"]
        ),
        ("Connection to mission computer lost",),
        "Mission computer regained",
    ),
)
"""Failsafes of PX4 1.17, in the order of their checks."""


class Px4:
    """PX4's implementation of `EmulatedFirmware` for a multicopter."""

    autopilot: int = mavlink.MAV_AUTOPILOT_PX4
    boot_mode = AUTO_LOITER
    land_mode = AUTO_LAND
    take_off_mode: int | None = AUTO_TAKEOFF
    hold_mode = AUTO_LOITER
    refused: int = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    request_refused: int = mavlink.MAV_RESULT_DENIED
    configured = CONFIGURED
    response: Response = PX4
    parameter_protocol: type[Parameters] = Px4Parameters
    system_id_parameter = "MAV_SYS_ID"
    setpoints_before_offboard = True
    acknowledges_modes_at_once = True
    text_habit = TextHabit(needs_ground_station=True, numbers_all=True, ending="\t")
    forwards_components = True
    lifts_off_by_setpoint = True
    heartbeat_on_mode_change = False
    returns_to_offboard = True
    min_interval_us = 0
    interval_refused: int = mavlink.MAV_RESULT_FAILED
    capabilities: int = (
        mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    flight_sw_version = 0x01_11_00_40
    pose_messages = POSE_MESSAGES
    position_needs_origin = False
    outside_lost_s = NO_AID_S
    force_skips_checks = False
    origin_text = ""
    timesync_period_s = 0.1
    failsafes: tuple[Failsafe, ...] = FAILSAFES
    healthy_unless_failed = 0
    sends_highres_imu = True
    ground_truth: int = mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION

    def __init__(self) -> None:
        self.streams_hz: dict[int, float] = {
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 30.0,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: 100.0,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: 5.0,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 5.0,
            mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 1.0,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
            mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: 10.0,
        }
        # PX4 sends it on every link; the companion does not read it, and each message takes time
        self.more_streams_hz: dict[int, float] = {mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 5.0}
        self.table = load_table("px4")

    def behaviour(self, mode: int) -> Behaviour | None:
        return BEHAVIOUR.get(mode)

    def mode_of(self, main: int, sub: int) -> int:
        return custom_mode(main, sub)

    def base_mode(self, mode: int, *, armed: bool) -> int:
        """The pilot, the vehicle itself, or in OFFBOARD neither controls the vehicle."""
        main = mode >> 16 & 0xFF
        return BASE_MODE | BASE_MODE_OF.get(main, 0) | (ARMED if armed else 0)

    def no_such_mode(self, mode: int) -> str:
        return ""

    def no_such_message(self, message_id: int) -> str:
        return ""

    def setpoint(
        self,
        message: Message,
        yaw_rad: float,
        position_ned_m: Vector3,
        parameters: ParameterValues,
    ) -> Target | Refusal:
        """Decode a setpoint in frame 1 or 8. One ignored velocity axis ignores all axes.

        Frame 8 has no position setpoints.
        """
        m: Any = message
        turned = m.coordinate_frame == mavlink.MAV_FRAME_BODY_NED
        if not turned and m.coordinate_frame != mavlink.MAV_FRAME_LOCAL_NED:
            frame = m.coordinate_frame
            return Refusal(f"coordinate frame {frame} unsupported")
        if not m.type_mask & IGNORE_VELOCITY:
            return _velocity(m, yaw_rad, turned=turned, parameters=parameters)
        position = (m.x, m.y, m.z)
        if turned or m.type_mask & IGNORE_POSITION or not all(map(math.isfinite, position)):
            return INVALID
        return PositionTarget(position)

    def setpoint_loss(self, parameters: ParameterValues) -> tuple[float, int | None]:
        action = int(parameters["COM_OBL_RC_ACT"])
        timeout_s = parameters["COM_OF_LOSS_T"] + OFFBOARD_LOSS_DELAY_S
        return timeout_s, OFFBOARD_LOSS_MODES.get(action, AUTO_LOITER)

    def sink_m_s(self, parameters: ParameterValues) -> float:
        return parameters["MPC_Z_VEL_MAX_DN"]

    def take_off_height_m(self, asked_m: float, parameters: ParameterValues) -> float:
        """MIS_TAKEOFF_ALT: the command's altitude is above sea level, unknown indoors."""
        return parameters["MIS_TAKEOFF_ALT"]

    def sources(self, parameters: ParameterValues) -> Sources:
        vision = int(parameters["EKF2_EV_CTRL"])
        return Sources(
            flow=parameters["EKF2_OF_CTRL"] > 0,
            outside_position=bool(vision & VISION_POSITION_BIT),
            outside_velocity=bool(vision & VISION_VELOCITY_BIT),
            outside_yaw=bool(vision & VISION_YAW_BIT),
        )

    def needs_origin(self, mode: int) -> bool:
        """Automatic modes use global positions; landing does not."""
        return mode in (AUTO_TAKEOFF, AUTO_LOITER, AUTO_RTL)

    def needs_position(self, mode: int) -> bool:
        return mode not in (MANUAL, STABILIZED, ALTCTL)

    def accepts_origin(self, place: Place) -> bool:
        return True

    def peripheral_failure(
        self, outside: ExternalMessages, now_s: float, parameters: ParameterValues
    ) -> str:
        return ""

    def denial(self, failure: str, *, arming: bool) -> tuple[str, ...]:
        failed = f"Preflight Fail: {failure}"
        return ("Arming denied: Resolve system health failures first", failed)[not arming :]

    def estimator_status(self, boot_us: int, health: EstimatorHealth) -> Message:
        """ESTIMATOR_STATUS (230)."""
        flags = estimator_flags(health)
        return mavlink.MAVLink_estimator_status_message(
            boot_us, flags, *(0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.05, 0.05)
        )

    def distance_echoes(
        self, outside: ExternalMessages, now_s: float, parameters: ParameterValues
    ) -> list[Message]:
        """Received messages, with their time of arrival."""
        echoes = []
        for arrived_s, message in outside.fresh(now_s):
            echo = copy(message)
            echo.time_boot_ms = round(arrived_s * 1000)
            echoes.append(echo)
        return echoes

    def true_state(self, truth: TrueState) -> Message:
        return hil_state_quaternion(truth)


def _velocity(
    m: Any, yaw_rad: float, *, turned: bool, parameters: ParameterValues
) -> VelocityTarget | Refusal:
    """Velocity with a yaw rate, an absolute yaw, or the current heading."""
    yaw = None if m.type_mask & IGNORE_YAW else m.yaw
    yaw_rate = 0.0 if m.type_mask & IGNORE_YAW_RATE else m.yaw_rate
    if not all(map(math.isfinite, (m.vx, m.vy, m.vz, yaw_rate, yaw or 0.0))):
        return INVALID
    vx, vy, vz = _limited((m.vx, m.vy, m.vz), parameters)
    north, east = frd_to_ned(vx, vy, yaw_rad) if turned else (vx, vy)
    return VelocityTarget((north, east, vz), yaw_rate, yaw)


def _limited(velocity: Vector3, parameters: ParameterValues) -> Vector3:
    """Limit a velocity to MPC_XY_VEL_MAX, MPC_Z_VEL_MAX_UP and MPC_Z_VEL_MAX_DN."""
    vx, vy, vz = velocity
    speed = math.hypot(vx, vy)
    most = max(0.0, parameters["MPC_XY_VEL_MAX"])
    share = most / speed if speed > most else 1.0
    up, down = parameters["MPC_Z_VEL_MAX_UP"], parameters["MPC_Z_VEL_MAX_DN"]
    return vx * share, vy * share, max(-up, min(down, vz))

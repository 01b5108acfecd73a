"""Emulates ArduCopter 4.6.3: numbers, results and texts as measured on a running one."""

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import Vector3, frd_to_ned, wrap_rad
from sitl.autopilot.estimation.external_messages import (
    AROUND,
    ExternalMessages,
    ExternalPoseMessages,
)
from sitl.autopilot.estimation.ground_truth import Place, sim_state
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
from sitl.autopilot.messages import MARKED
from sitl.autopilot.parameters.ardupilot import ArduPilotParameters
from sitl.autopilot.parameters.protocol import Parameters
from sitl.autopilot.parameters.table import load_table
from sitl.autopilot.response import ARDUCOPTER, Response
from sitl.autopilot.streams import Message
from sitl.core.truth import TrueState

STABILIZE, ALT_HOLD, AUTO, GUIDED, LOITER, RTL, LAND = 0, 2, 3, 4, 5, 6, 9
POSHOLD, BRAKE, GUIDED_NOGPS = 16, 17, 20
"""custom_mode numbers of ArduCopter."""
BEHAVIOUR = {
    **dict.fromkeys((AUTO, RTL, BRAKE), Behaviour.HOLD),
    **dict.fromkeys((ALT_HOLD, LOITER, POSHOLD), Behaviour.CLIMB_BY_STICK),
    STABILIZE: Behaviour.THRUST_BY_STICK,
    GUIDED: Behaviour.OFFBOARD,
    GUIDED_NOGPS: Behaviour.OFFBOARD,
    LAND: Behaviour.LAND,
}
"""Behaviour by custom_mode."""

BASE_MODE_IDLE = 81
"""HEARTBEAT.base_mode when disarmed."""
BASE_MODE_GUIDED_BIT = 8
"""Added in GUIDED: 89, and 217 when armed."""

EKF_UNINITIALISED = 1024
"""EKF_STATUS_REPORT (193) flags until the attitude has settled; then flags of other states."""
EKF_READY = 895
"""Flags with an absolute position from external poses. Measured on ArduCopter 4.6.3."""
EKF_FLOW_ONLY = 367
"""A relative position, no absolute one (from ArduPilot's source)."""
EKF_WITHOUT_POSITION = 167
"""Flags without a position. Measured on ArduCopter 4.6.3 before the first external pose."""
EKF_FADING, EKF_FADING_AFTER_S = 831, 5.0
"""Flags from this age of the last external pose on, s."""
EKF_LOST, EKF_LOST_AFTER_S = 37, 8.0
"""Flags from this age of the last external pose on, s; then the EKF failsafe lands."""
VISION_TIMEOUT_S = 0.3
"""Age of the last external pose from which arming is refused, s."""
FLOW, EXTERNAL_NAV = 5, 6
"""Values of EK3_SRC1_VELXY and similar parameters."""
MAVLINK_RANGEFINDER, MAVLINK_PROXIMITY = 10, 2
"""Values of RNGFND1_TYPE and PRX1_TYPE that select DISTANCE_SENSOR as the source."""

IGNORE_POSITION, IGNORE_VELOCITY, IGNORE_ACCELERATION = 0x0007, 0x0038, 0x01C0
"""Bits of SET_POSITION_TARGET_LOCAL_NED.type_mask; also those below."""
FORCE = 0x0200
"""Bit FORCE_SET: the acceleration fields contain a force."""
IGNORE_YAW, IGNORE_YAW_RATE = 0x0400, 0x0800
"""Bits that exclude heading and yaw rate."""
MAX_VALUE = 1000.0
"""Largest value in a setpoint; a larger one stops the vehicle."""
SINK_M_S = 2.2
"""Descent rate with the throttle stick low in LOITER, m/s. Measured at the default PILOT_SPEED_UP
of 2.5 m/s."""
MIN_GUID_TIMEOUT_S = 0.1
"""Lower bound of GUID_TIMEOUT, s."""
TURNED_FRAMES = (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED)
OFFSET_FRAMES = (*TURNED_FRAMES, mavlink.MAV_FRAME_LOCAL_OFFSET_NED)
FRAMES = (*OFFSET_FRAMES, mavlink.MAV_FRAME_LOCAL_NED)
"""Frames rotated by the heading, offsets from the position, and all accepted ones."""
STOP = Refusal(stops=True)

CONFIGURED: dict[str, float] = {
    "BATT_MONITOR": 4,
    "EK3_SRC1_POSXY": 0,
    "EK3_SRC1_VELXY": FLOW,
    "EK3_SRC1_VELZ": 0,
    "FLOW_TYPE": 4,
    "FRAME_CLASS": 1,
    "FS_THR_ENABLE": 0,
    "GPS1_TYPE": 0,
    "RNGFND1_TYPE": 100,
}
"""This vehicle has optical flow and its own rangefinder, but no GPS and no remote control."""

LAND_ACTIONS = (1, 3, 4, 5)
"""Values of BATT_FS_LOW_ACT and similar parameters that land without a place to return to."""


def _land_if(parameter: str) -> Callable[[ParameterValues], int | None]:
    return lambda parameters: LAND if parameters[parameter] in LAND_ACTIONS else None


def _battery_below(parameter: str) -> Callable[[Condition, ParameterValues], bool]:
    return lambda condition, parameters: condition.battery_v < parameters[parameter]


def _ground_station_lost(condition: Condition, parameters: ParameterValues) -> bool:
    age_s = condition.ground_station_age_s
    wanted = parameters["FS_GCS_ENABLE"] > 0 and math.isfinite(age_s)
    return wanted and age_s > parameters["FS_GCS_TIMEOUT"]


FAILSAFES = (
    Failsafe(
        lambda condition, _: condition.unaided_s > EKF_LOST_AFTER_S,
        ("EKF variance", "EKF Failsafe: changed to LAND Mode"),
        "EKF Failsafe Cleared",
        lambda _: LAND,
    ),
    Failsafe(
        _battery_below("BATT_LOW_VOLT"), ("Battery 1 is low",), mode=_land_if("BATT_FS_LOW_ACT")
    ),
    Failsafe(
        _battery_below("BATT_CRT_VOLT"),
        ("Battery 1 is critical",),
        mode=_land_if("BATT_FS_CRT_ACT"),
    ),
    Failsafe(
        _ground_station_lost, ("GCS Failsafe",), "GCS Failsafe Cleared", _land_if("FS_GCS_ENABLE")
    ),
)
"""Failsafes of ArduCopter 4.6.3, in the order of their checks."""


class ArduPilot:
    """ArduCopter's implementation of `EmulatedFirmware`."""

    autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    boot_mode = STABILIZE
    land_mode = LAND
    take_off_mode: int | None = None
    hold_mode = LOITER
    refused: int = mavlink.MAV_RESULT_FAILED
    request_refused: int = mavlink.MAV_RESULT_FAILED
    configured = CONFIGURED
    parameter_protocol: type[Parameters] = ArduPilotParameters
    system_id_parameter = "SYSID_THISMAV"
    setpoints_before_offboard = False
    acknowledges_modes_at_once = False
    text_habit = MARKED
    forwards_components = True
    lifts_off_by_setpoint = False
    heartbeat_on_mode_change = True
    returns_to_offboard = False
    min_interval_us = 2000
    interval_refused: int = mavlink.MAV_RESULT_DENIED
    response: Response = ARDUCOPTER
    capabilities = 64495
    flight_sw_version = 67502976
    pose_messages = ExternalPoseMessages((mavlink.MAV_FRAME_LOCAL_FRD,))
    position_needs_origin = True
    outside_lost_s = EKF_LOST_AFTER_S
    force_skips_checks = True
    origin_text = "EKF3 IMU0 origin set"
    timesync_period_s = 10.0
    failsafes: tuple[Failsafe, ...] = FAILSAFES
    healthy_unless_failed: int = mavlink.MAV_SYS_STATUS_GEOFENCE
    sends_highres_imu = False
    ground_truth: int = mavlink.MAVLINK_MSG_ID_SIM_STATE

    def __init__(self) -> None:
        self.streams_hz: dict[int, float] = {}
        self.more_streams_hz: dict[int, float] = {}
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

    def no_such_message(self, message_id: int) -> str:
        return f"No ap_message for mavlink id ({message_id})"

    def setpoint(
        self,
        message: Message,
        yaw_rad: float,
        position_ned_m: Vector3,
        parameters: ParameterValues,
    ) -> Target | Refusal:
        """Decode a setpoint. Frames 1 and 7 are NED; 8 and 9 are rotated by the heading.

        Other frames, masks without a usable setpoint, forced acceleration, NaN and absurd values
        restart GUIDED, which stops the vehicle.
        """
        m: Any = message
        mask = m.type_mask
        forced = mask & FORCE and not mask & IGNORE_ACCELERATION
        if m.coordinate_frame not in FRAMES or forced:
            return STOP
        turned = m.coordinate_frame in TURNED_FRAMES
        if not mask & IGNORE_VELOCITY:
            return _velocity(m, yaw_rad, turned=turned, parameters=parameters)
        if mask & IGNORE_POSITION or not mask & IGNORE_ACCELERATION:
            return STOP
        if not _are_sane(m.x, m.y, m.z):
            return STOP
        north, east = frd_to_ned(m.x, m.y, yaw_rad) if turned else (m.x, m.y)
        offset = position_ned_m if m.coordinate_frame in OFFSET_FRAMES else (0.0, 0.0, 0.0)
        return PositionTarget((north + offset[0], east + offset[1], m.z + offset[2]))

    def setpoint_loss(self, parameters: ParameterValues) -> tuple[float, int | None]:
        return max(parameters["GUID_TIMEOUT"], MIN_GUID_TIMEOUT_S), None

    def sink_m_s(self, parameters: ParameterValues) -> float:
        return SINK_M_S

    def take_off_height_m(self, asked_m: float, parameters: ParameterValues) -> float:
        return asked_m

    def sources(self, parameters: ParameterValues) -> Sources:
        vision = parameters["VISO_TYPE"] > 0
        return Sources(
            flow=parameters["EK3_SRC1_VELXY"] == FLOW and parameters["FLOW_TYPE"] > 0,
            outside_position=vision and parameters["EK3_SRC1_POSXY"] == EXTERNAL_NAV,
            outside_velocity=vision and parameters["EK3_SRC1_VELXY"] == EXTERNAL_NAV,
            outside_yaw=vision and parameters["EK3_SRC1_YAW"] == EXTERNAL_NAV,
        )

    def needs_origin(self, mode: int) -> bool:
        return mode != GUIDED_NOGPS

    def needs_position(self, mode: int) -> bool:
        return mode != GUIDED_NOGPS

    def accepts_origin(self, place: Place) -> bool:
        """An all-zero origin counts as not set (from ArduPilot's source)."""
        return any(place)

    def peripheral_failure(
        self, outside: ExternalMessages, now_s: float, parameters: ParameterValues
    ) -> str:
        if parameters["VISO_TYPE"] > 0 and outside.pose_age_s(now_s) > VISION_TIMEOUT_S:
            return "VisOdom: not healthy"
        down = int(parameters["RNGFND1_ORIENT"])
        if parameters["RNGFND1_TYPE"] == MAVLINK_RANGEFINDER and not outside.has_range(down, now_s):
            return "Rangefinder 1: No Data"
        if parameters["PRX1_TYPE"] == MAVLINK_PROXIMITY and not outside.has_proximity(now_s):
            return "PRX1: No Data"
        return ""

    def denial(self, failure: str, *, arming: bool) -> tuple[str, ...]:
        return (f"{'Arm' if arming else 'PreArm'}: {failure}",)

    def estimator_status(self, boot_us: int, health: EstimatorHealth) -> Message:
        """EKF_STATUS_REPORT (193)."""
        return mavlink.MAVLink_ekf_status_report_message(
            _ekf_flags(health), 0.1, 0.1, 0.1, 0.1, 0.0
        )

    def distance_echoes(
        self, outside: ExternalMessages, now_s: float, parameters: ParameterValues
    ) -> list[Message]:
        """The rangefinder with its instance as id; proximity with id 10 + sector."""
        fresh = outside.fresh_ranges(now_s)
        echoes = []
        down = int(parameters["RNGFND1_ORIENT"])
        if parameters["RNGFND1_TYPE"] == MAVLINK_RANGEFINDER and down in fresh:
            echoes.append(_echo(fresh[down], 0, now_s))
        if parameters["PRX1_TYPE"] == MAVLINK_PROXIMITY:
            echoes += [_echo(fresh[o], 10 + AROUND.index(o), now_s) for o in AROUND if o in fresh]
        return echoes

    def true_state(self, truth: TrueState) -> Message:
        return sim_state(truth)


def _are_sane(*values: float) -> bool:
    return all(math.isfinite(v) and abs(v) <= MAX_VALUE for v in values)


def _velocity(
    m: Any, yaw_rad: float, *, turned: bool, parameters: ParameterValues
) -> VelocityTarget | Refusal:
    """Velocity with a yaw, a yaw rate, or neither; WP_YAW_BEHAVIOR then selects the heading."""
    yaw_rate = None if m.type_mask & IGNORE_YAW_RATE else m.yaw_rate
    yaw = None if m.type_mask & IGNORE_YAW else m.yaw
    if not _are_sane(m.vx, m.vy, m.vz, yaw_rate or 0.0, yaw or 0.0):
        return STOP
    if yaw is not None and turned:
        yaw = wrap_rad(yaw_rad + yaw)
    if yaw is None and yaw_rate is None and parameters["WP_YAW_BEHAVIOR"] == 0:
        yaw_rate = 0.0
    north, east = frd_to_ned(m.vx, m.vy, yaw_rad) if turned else (m.vx, m.vy)
    return VelocityTarget((north, east, m.vz), yaw_rate, yaw)


def _ekf_flags(health: EstimatorHealth) -> int:
    age_s, sources = health.outside_age_s, health.sources
    if not health.settled:
        return EKF_UNINITIALISED
    if not health.has_position:
        seen = math.isfinite(age_s) and sources.needs_outside
        return EKF_LOST if seen and age_s > EKF_LOST_AFTER_S else EKF_WITHOUT_POSITION
    if sources.outside_position and age_s <= EKF_FADING_AFTER_S:
        return EKF_READY
    return EKF_FLOW_ONLY if sources.flow else EKF_FADING


def _echo(message: Message, sensor_id: int, now_s: float) -> Message:
    m: Any = message
    return mavlink.MAVLink_distance_sensor_message(
        round(now_s * 1000),
        *(m.min_distance, m.max_distance, m.current_distance),
        *(m.type, sensor_id, m.orientation, 0),
    )

"""What differs between autopilots, seen from the companion."""

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.messages import Command, CommandKind

Parameters = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter as it travels: `wire_value` is what stands in PARAM_SET's float."""

    name: str
    wire_value: float
    kind: int
    """MAV_PARAM_TYPE."""


def _real(name: str, value: float) -> Parameter:
    return Parameter(name, value, mavlink.MAV_PARAM_TYPE_REAL32)


def _bytewise_int(name: str, value: int) -> Parameter:
    """PX4 sends an integer's bytes in place of the float."""
    (wire_value,) = struct.unpack("<f", struct.pack("<i", value))
    return Parameter(name, wire_value, mavlink.MAV_PARAM_TYPE_INT32)


MULTICOPTERS = frozenset(
    {
        mavlink.MAV_TYPE_TRICOPTER,
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_TYPE_HEXAROTOR,
        mavlink.MAV_TYPE_OCTOROTOR,
        mavlink.MAV_TYPE_DECAROTOR,
        mavlink.MAV_TYPE_DODECAROTOR,
    }
)
"""HEARTBEAT.type of what is flown. The same mode number is another mode on other vehicles: 4 is
GUIDED on a copter of ArduPilot's, HOLD on a rover, ACRO on a plane."""

NOT_SETTLED = "its estimator has not settled"
NO_VELOCITY = "its estimator has no velocity source"
NO_POSITION = "its estimator has no position"


class Firmware(Protocol):
    """One kind of autopilot."""

    autopilot: ClassVar[int]
    """HEARTBEAT.autopilot of this kind."""
    takes_off_by_setpoint: ClassVar[bool]
    """It lifts off by following a climbing setpoint in its offboard mode."""
    estimator_message: ClassVar[int]
    """Which message tells the state of the estimator."""
    texts_need: ClassVar[Mapping[str, int]]
    """If it tells texts only to ground stations: how it must be set that we may beat as one."""
    pose_needs: ClassVar[Mapping[str, int]]
    """How it must be set to fly by our pose, and by a velocity of its own."""

    def mode_name(self, custom_mode: int) -> str: ...

    def is_offboard(self, custom_mode: int) -> bool:
        """In this mode the autopilot follows our setpoints."""
        ...

    def estimate_complaint(self, message: Any) -> str:
        """Why the position may not be used, by the estimator's message; empty if it may."""
        ...

    def safety_parameters(self, setpoint_loss_s: float) -> tuple[Parameter, ...]:
        """What bounds how long an old setpoint is flown, and what happens then; as we want them."""
        ...

    def parameter_value(self, message: Any) -> float:
        """What a PARAM_VALUE (22) tells."""
        ...

    def command(self, command: Command) -> tuple[int, Parameters]:
        """The MAV_CMD and its parameters."""
        ...


ARDUCOPTER_MODES = {
    0: "STABILIZE",
    2: "ALT_HOLD",
    3: "AUTO",
    4: "GUIDED",
    5: "LOITER",
    6: "RTL",
    9: "LAND",
    16: "POSHOLD",
    17: "BRAKE",
    20: "GUIDED_NOGPS",
}


class ArduPilot:
    """ArduCopter 4.6."""

    autopilot: ClassVar[int] = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    takes_off_by_setpoint: ClassVar[bool] = False
    estimator_message: ClassVar[int] = mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT
    texts_need: ClassVar[Mapping[str, int]] = MappingProxyType({})
    pose_needs: ClassVar[Mapping[str, int]] = MappingProxyType(
        {"VISO_TYPE": 1, "EK3_SRC1_POSXY": 6, "EK3_SRC1_VELXY": 5, "EK3_SRC1_YAW": 6}
    )

    GUIDED, LAND = 4, 9
    POSITION_FLAGS = mavlink.EKF_POS_HORIZ_REL | mavlink.EKF_POS_HORIZ_ABS
    """One is enough: with optical flow alone there is only a relative position."""

    def mode_name(self, custom_mode: int) -> str:
        return ARDUCOPTER_MODES.get(custom_mode, f"mode {custom_mode}")

    def is_offboard(self, custom_mode: int) -> bool:
        return custom_mode == self.GUIDED

    def estimate_complaint(self, message: Any) -> str:
        flags = message.flags
        if flags & mavlink.EKF_UNINITIALIZED or not flags & mavlink.EKF_ATTITUDE:
            return NOT_SETTLED
        if flags & mavlink.EKF_CONST_POS_MODE or not flags & mavlink.EKF_VELOCITY_HORIZ:
            return NO_VELOCITY
        return "" if flags & self.POSITION_FLAGS else NO_POSITION

    def parameter_value(self, message: Any) -> float:
        return float(message.param_value)

    def safety_parameters(self, setpoint_loss_s: float) -> tuple[Parameter, ...]:
        return (_real("GUID_TIMEOUT", setpoint_loss_s),)

    def command(self, command: Command) -> tuple[int, Parameters]:
        custom = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        match command.kind:
            case CommandKind.OFFBOARD_MODE:
                return mavlink.MAV_CMD_DO_SET_MODE, (custom, self.GUIDED)
            case CommandKind.ARM:
                return mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1,)
            case CommandKind.DISARM:
                return mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0,)
            case CommandKind.TAKE_OFF:
                return mavlink.MAV_CMD_NAV_TAKEOFF, (0, 0, 0, 0, 0, 0, command.height_m)
            case CommandKind.LAND:
                return mavlink.MAV_CMD_DO_SET_MODE, (custom, self.LAND)


def px4_mode(main: int, sub: int = 0) -> int:
    """HEARTBEAT.custom_mode of PX4."""
    return main << 16 | sub << 24


PX4_MODES = {
    px4_mode(1): "MANUAL",
    px4_mode(2): "ALTCTL",
    px4_mode(3): "POSCTL",
    px4_mode(5): "ACRO",
    px4_mode(6): "OFFBOARD",
    px4_mode(7): "STABILIZED",
    px4_mode(4, 2): "TAKEOFF",
    px4_mode(4, 3): "HOLD",
    px4_mode(4, 4): "MISSION",
    px4_mode(4, 5): "RTL",
    px4_mode(4, 6): "LAND",
}
PX4_LAND_ON_SETPOINT_LOSS = 4


class Px4:
    """PX4 1.16 and later, multicopter."""

    autopilot: ClassVar[int] = mavlink.MAV_AUTOPILOT_PX4
    takes_off_by_setpoint: ClassVar[bool] = True
    estimator_message: ClassVar[int] = mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS
    texts_need: ClassVar[Mapping[str, int]] = MappingProxyType({"NAV_DLL_ACT": 0})
    pose_needs: ClassVar[Mapping[str, int]] = MappingProxyType(
        {"EKF2_EV_CTRL": 9, "EKF2_OF_CTRL": 1}
    )

    OFFBOARD_MAIN, AUTO_MAIN, LAND_SUB = 6, 4, 6

    def mode_name(self, custom_mode: int) -> str:
        return PX4_MODES.get(custom_mode, f"mode {custom_mode}")

    def is_offboard(self, custom_mode: int) -> bool:
        return custom_mode == px4_mode(self.OFFBOARD_MAIN)

    def estimate_complaint(self, message: Any) -> str:
        """CONST_POS_MODE tells nothing: since 1.16 every vehicle that stands sets it."""
        flags = message.flags
        if not flags & mavlink.ESTIMATOR_ATTITUDE:
            return NOT_SETTLED
        if not flags & mavlink.ESTIMATOR_VELOCITY_HORIZ:
            return NO_VELOCITY
        return "" if flags & mavlink.ESTIMATOR_POS_HORIZ_REL else NO_POSITION

    def parameter_value(self, message: Any) -> float:
        if message.param_type != mavlink.MAV_PARAM_TYPE_INT32:
            return float(message.param_value)
        (number,) = struct.unpack("<i", struct.pack("<f", message.param_value))
        return float(number)

    def safety_parameters(self, setpoint_loss_s: float) -> tuple[Parameter, ...]:
        return (
            _real("COM_OF_LOSS_T", setpoint_loss_s),
            _bytewise_int("COM_OBL_RC_ACT", PX4_LAND_ON_SETPOINT_LOSS),
        )

    def command(self, command: Command) -> tuple[int, Parameters]:
        custom = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        match command.kind:
            case CommandKind.OFFBOARD_MODE:
                return mavlink.MAV_CMD_DO_SET_MODE, (custom, self.OFFBOARD_MAIN)
            case CommandKind.ARM:
                return mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1,)
            case CommandKind.DISARM:
                return mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0,)
            case CommandKind.TAKE_OFF:
                return mavlink.MAV_CMD_NAV_TAKEOFF, (math.nan,) * 7
            case CommandKind.LAND:
                return mavlink.MAV_CMD_DO_SET_MODE, (custom, self.AUTO_MAIN, self.LAND_SUB)


FIRMWARES: tuple[Firmware, ...] = (ArduPilot(), Px4())


def firmware_of(autopilot: int, vehicle_type: int) -> Firmware | None:
    """The firmware for HEARTBEAT.autopilot and .type; None if such a vehicle is not flown."""
    if vehicle_type not in MULTICOPTERS:
        return None
    return next((d for d in FIRMWARES if d.autopilot == autopilot), None)

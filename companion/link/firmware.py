"""Defines the differences between ArduPilot and PX4: modes, parameters and commands."""

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.messages import Command, CommandKind

Parameters = tuple[float, ...]
"""Parameters of a MAV_CMD."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter in its wire format: `wire_value` is the float field of PARAM_SET (23)."""

    name: str
    wire_value: float
    kind: int
    """MAV_PARAM_TYPE."""


def _real(name: str, value: float) -> Parameter:
    return Parameter(name, value, mavlink.MAV_PARAM_TYPE_REAL32)


def _bytewise_int(name: str, value: int) -> Parameter:
    """PX4 sends the bytes of an integer in the float field."""
    (wire_value,) = struct.unpack("<f", struct.pack("<i", value))
    return Parameter(name, wire_value, mavlink.MAV_PARAM_TYPE_INT32)


FENCE_OUTSIDE_M = 1.0
"""Distance of the autopilot's fence beyond the companion's limits, m: the least FENCE_MARGIN, by
which ArduPilot's avoidance stops before its fence."""


@dataclass(frozen=True, slots=True)
class Fence:
    """Limits of a flight from the take-off place, m; None: no limit."""

    height_m: float | None
    distance_m: float | None


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
"""Supported values of HEARTBEAT.type.

On other vehicles the same mode number is another mode: on ArduPilot, 4 is GUIDED on a copter, HOLD
on a rover, ACRO on a plane.
"""

NOT_SETTLED = "its estimator has not settled"
NO_VELOCITY = "its estimator has no velocity source"
NO_POSITION = "its estimator has no position"
"""Results of `Firmware.estimate_complaint`, the same for all firmwares."""


class Firmware(Protocol):
    """Interface to one autopilot firmware."""

    autopilot: ClassVar[int]
    """Value of HEARTBEAT.autopilot."""
    takes_off_by_setpoint: ClassVar[bool]
    """Take-off is a climbing setpoint in the offboard mode, not a command."""
    estimator_message: ClassVar[int]
    """Id of the message that reports the estimator state."""
    texts_need: ClassVar[Mapping[str, int]]
    """Parameter values required to send a ground station's heartbeat; empty if none is needed.

    A firmware that sends texts only to ground stations needs one: see `ground_station`.
    """
    pose_needs: ClassVar[Mapping[str, int]]
    """Parameter values required to use our pose together with the autopilot's own velocity."""
    holding_modes: ClassVar[tuple[str, ...]]
    """Modes in which the drone holds its height when the pilot takes it over at mid-stick."""
    lands_on_setpoint_loss: ClassVar[bool]
    """After the setpoint timeout it changes to LAND; otherwise it brakes, which only shows in
    flight."""

    def mode_name(self, custom_mode: int) -> str: ...

    def is_offboard(self, custom_mode: int) -> bool:
        """True if the autopilot follows our setpoints in this mode."""
        ...

    def estimate_complaint(self, message: Any) -> str:
        """Reason why the position cannot be used, from the estimator message; empty if it can."""
        ...

    def safety_parameters(self, setpoint_loss_s: float) -> tuple[Parameter, ...]:
        """Required parameters for the setpoint timeout and the action after it."""
        ...

    def fence_parameters(self, fence: Fence) -> tuple[Parameter, ...]:
        """Parameters of a fence `FENCE_OUTSIDE_M` beyond the limits, at which the drone lands."""
        ...

    def parameter_value(self, message: Any) -> float:
        """Decoded value of a PARAM_VALUE (22)."""
        ...

    def command(self, command: Command) -> tuple[int, Parameters]:
        """MAV_CMD and its parameters for a command."""
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
"""Names of HEARTBEAT.custom_mode of ArduCopter."""


class ArduPilot:
    """Firmware interface of ArduCopter 4.6."""

    autopilot: ClassVar[int] = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    takes_off_by_setpoint: ClassVar[bool] = False
    estimator_message: ClassVar[int] = mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT
    texts_need: ClassVar[Mapping[str, int]] = MappingProxyType({})
    pose_needs: ClassVar[Mapping[str, int]] = MappingProxyType(
        {"VISO_TYPE": 1, "EK3_SRC1_POSXY": 6, "EK3_SRC1_VELXY": 5, "EK3_SRC1_YAW": 6}
    )
    holding_modes: ClassVar[tuple[str, ...]] = ("LOITER", "POSHOLD", "ALT_HOLD")
    lands_on_setpoint_loss: ClassVar[bool] = False

    GUIDED, LAND = 4, 9
    """HEARTBEAT.custom_mode of the two modes."""
    FENCE_HEIGHT, FENCE_CIRCLE, FENCE_LANDS = 1, 2, 2
    """Bits of FENCE_TYPE, and the value of FENCE_ACTION that always lands."""
    POSITION_FLAGS = mavlink.EKF_POS_HORIZ_REL | mavlink.EKF_POS_HORIZ_ABS
    """One of the flags is sufficient: with optical flow alone, the position is only relative."""

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

    def fence_parameters(self, fence: Fence) -> tuple[Parameter, ...]:
        parameters = [
            _real("FENCE_MARGIN", FENCE_OUTSIDE_M),
            _real("FENCE_ACTION", self.FENCE_LANDS),
        ]
        types = 0
        if fence.height_m is not None:
            types |= self.FENCE_HEIGHT
            parameters.append(_real("FENCE_ALT_MAX", fence.height_m + FENCE_OUTSIDE_M))
        if fence.distance_m is not None:
            types |= self.FENCE_CIRCLE
            parameters.append(_real("FENCE_RADIUS", fence.distance_m + FENCE_OUTSIDE_M))
        return (*parameters, _real("FENCE_TYPE", types), _real("FENCE_ENABLE", 1))

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
    """Compose HEARTBEAT.custom_mode of PX4 from main mode and sub mode."""
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
"""Names of HEARTBEAT.custom_mode of PX4."""
PX4_LAND_ON_SETPOINT_LOSS = 4
"""Value of PX4's COM_OBL_RC_ACT: land after the setpoint timeout."""


class Px4:
    """Firmware interface of PX4 1.16 and later, multicopter."""

    autopilot: ClassVar[int] = mavlink.MAV_AUTOPILOT_PX4
    takes_off_by_setpoint: ClassVar[bool] = True
    estimator_message: ClassVar[int] = mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS
    texts_need: ClassVar[Mapping[str, int]] = MappingProxyType({"NAV_DLL_ACT": 0})
    pose_needs: ClassVar[Mapping[str, int]] = MappingProxyType(
        {"EKF2_EV_CTRL": 9, "EKF2_OF_CTRL": 1}
    )
    holding_modes: ClassVar[tuple[str, ...]] = ("POSCTL", "ALTCTL", "HOLD")
    lands_on_setpoint_loss: ClassVar[bool] = True

    OFFBOARD_MAIN, AUTO_MAIN, LAND_SUB = 6, 4, 6
    """Main modes OFFBOARD and AUTO, and the sub mode LAND of AUTO."""
    FENCE_LANDS = 5
    """Value of GF_ACTION that lands."""

    def mode_name(self, custom_mode: int) -> str:
        return PX4_MODES.get(custom_mode, f"mode {custom_mode}")

    def is_offboard(self, custom_mode: int) -> bool:
        return custom_mode == px4_mode(self.OFFBOARD_MAIN)

    def estimate_complaint(self, message: Any) -> str:
        """As in `Firmware`, without CONST_POS_MODE: since 1.16 PX4 sets it at every standstill."""
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

    def fence_parameters(self, fence: Fence) -> tuple[Parameter, ...]:
        limits = (("GF_MAX_VER_DIST", fence.height_m), ("GF_MAX_HOR_DIST", fence.distance_m))
        parameters = [_real(n, limit + FENCE_OUTSIDE_M) for n, limit in limits if limit is not None]
        return (*parameters, _bytewise_int("GF_ACTION", self.FENCE_LANDS))

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
"""Supported firmwares."""


def firmware_of(autopilot: int, vehicle_type: int) -> Firmware | None:
    """Firmware for HEARTBEAT.autopilot and .type; None if the vehicle is not supported."""
    if vehicle_type not in MULTICOPTERS:
        return None
    return next((d for d in FIRMWARES if d.autopilot == autopilot), None)

"""What differs between autopilots, seen from the companion."""

from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.messages import Command, CommandKind

Parameters = tuple[float, ...]


class Dialect(Protocol):
    """One kind of autopilot."""

    autopilot: int
    """HEARTBEAT.autopilot of this kind."""
    setpoint_timeout: tuple[str, float]
    """The parameter that bounds how long an old setpoint is flown, and the value we want."""
    estimator_message: int
    """Which message tells the state of the estimator."""

    def mode_name(self, custom_mode: int) -> str: ...

    def is_offboard(self, custom_mode: int) -> bool:
        """In this mode the autopilot follows our setpoints."""
        ...

    def is_estimate_ready(self, message: Any) -> bool:
        """The estimator's message says that the position may be used."""
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

    autopilot = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    setpoint_timeout = ("GUID_TIMEOUT", 0.5)
    estimator_message = mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT

    GUIDED, LAND = 4, 9
    NEEDED_FLAGS = mavlink.EKF_ATTITUDE | mavlink.EKF_VELOCITY_HORIZ | mavlink.EKF_POS_HORIZ_ABS
    FORBIDDEN_FLAGS = mavlink.EKF_CONST_POS_MODE | mavlink.EKF_UNINITIALIZED

    def mode_name(self, custom_mode: int) -> str:
        return ARDUCOPTER_MODES.get(custom_mode, f"mode {custom_mode}")

    def is_offboard(self, custom_mode: int) -> bool:
        return custom_mode == self.GUIDED

    def is_estimate_ready(self, message: Any) -> bool:
        needed = message.flags & self.NEEDED_FLAGS == self.NEEDED_FLAGS
        return needed and not message.flags & self.FORBIDDEN_FLAGS

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


DIALECTS: tuple[Dialect, ...] = (ArduPilot(),)


def dialect_of(autopilot: int) -> Dialect | None:
    """The dialect for a HEARTBEAT.autopilot; None if it is not supported."""
    return next((d for d in DIALECTS if d.autopilot == autopilot), None)

"""What makes one autopilot different from another; `core` knows only this."""

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from companion.frames import Vector3
from sitl.autopilot.parameters.protocol import Parameters
from sitl.autopilot.parameters.table import Table, initial_values
from sitl.autopilot.streams import Message


class Behaviour(enum.Enum):
    """What a mode does, whatever it is called."""

    HOLD = "stays where it is, for want of stick movements"
    OFFBOARD = "follows setpoints"
    TAKE_OFF = "climbs to a height, then holds"
    LAND = "descends and disarms"


@dataclass(frozen=True, slots=True)
class VelocityTarget:
    """An accepted velocity setpoint, in the autopilot's estimated NED."""

    velocity_ned_m_s: Vector3
    yaw_rate_rad_s: float


@dataclass(frozen=True, slots=True)
class Refusal:
    """A setpoint that is not flown; ArduPilot stops without a word, PX4 goes on and complains."""

    text: str = ""
    stops: bool = False


class Personality(Protocol):
    """One kind of autopilot."""

    autopilot: int
    """HEARTBEAT.autopilot."""
    boot_mode: int
    land_mode: int
    take_off_mode: int | None
    """The mode that NAV_TAKEOFF enters; None if it climbs within its offboard mode."""
    hold_mode: int
    """Where a take-off mode goes on to."""
    refused: int
    """MAV_RESULT of refused arming, disarming and modes."""
    streams_hz: dict[int, float]
    """What is sent unasked."""
    table: Table
    """Its parameters, with the firmware's defaults."""
    configured: dict[str, float]
    """What this vehicle has been set up with, to fly without GPS."""
    parameter_protocol: type[Parameters]
    system_id_parameter: str
    """Read at the start only."""
    setpoints_before_offboard: bool
    """The offboard mode is refused without a stream of setpoints."""
    lifts_off_by_setpoint: bool
    capabilities: int
    flight_sw_version: int

    def behaviour(self, mode: int) -> Behaviour | None:
        """What a custom_mode does; None if there is no such mode."""
        ...

    def mode_of(self, main: int, sub: int) -> int:
        """The custom_mode that parameters 2 and 3 of DO_SET_MODE name."""
        ...

    def base_mode(self, mode: int, *, armed: bool) -> int: ...

    def no_such_mode(self, mode: int) -> str: ...

    def setpoint(
        self, message: Message, yaw_rad: float, parameters: dict[str, float]
    ) -> VelocityTarget | Refusal:
        """What SET_POSITION_TARGET_LOCAL_NED (84) asks for."""
        ...

    def setpoint_loss(self, parameters: dict[str, float]) -> tuple[float, int | None]:
        """After how long without setpoints, and into which mode; None: it only brakes."""
        ...

    def take_off_height_m(self, asked_m: float, parameters: dict[str, float]) -> float: ...

    def estimator_status(self, boot_us: int, *, has_position: bool) -> Message: ...


def boot_values(personality: Personality, parameters: Mapping[str, float]) -> dict[str, float]:
    """What its parameters hold at the start."""
    return initial_values(personality.table, {**personality.configured, **parameters})


def system_id(personality: Personality, values: Mapping[str, float]) -> int:
    """The MAVLink system that it is from its start on; 1 if the parameter holds none."""
    asked = int(values[personality.system_id_parameter])
    return asked if 1 <= asked <= 255 else 1

"""What makes one autopilot different from another; `core` knows only this."""

import enum
from collections.abc import Callable, Mapping
from typing import Protocol

from companion.core.frames import Vector3
from companion.core.values import value
from sitl.autopilot.estimation.ground_truth import Place
from sitl.autopilot.estimation.outside import Outside, PoseMessages
from sitl.autopilot.messages import TextHabit
from sitl.autopilot.parameters.protocol import Parameters
from sitl.autopilot.parameters.table import Table, initial_values
from sitl.autopilot.response import Response
from sitl.autopilot.streams import Message
from sitl.core.truth import TrueState


class Behaviour(enum.Enum):
    """What a mode does, whatever it is called."""

    HOLD = "stays where it is, whatever the sticks"
    CLIMB_BY_STICK = "holds; the throttle stick commands the climb, below its middle the descent"
    THRUST_BY_STICK = "the throttle stick commands the thrust"
    OFFBOARD = "follows setpoints"
    TAKE_OFF = "climbs to a height, then holds"
    LAND = "descends and disarms"


class Throttle(enum.StrEnum):
    """Where the pilot's throttle stick is."""

    LOW = "low"
    MID = "mid"


@value
class VelocityTarget:
    """An accepted velocity setpoint, in the autopilot's estimated NED.

    Neither yaw nor yaw rate: the autopilot turns as it sees fit.
    """

    velocity_ned_m_s: Vector3
    yaw_rate_rad_s: float | None = None
    yaw_rad: float | None = None


@value
class PositionTarget:
    """An accepted position setpoint, in the autopilot's estimated NED; it turns towards it."""

    position_ned_m: Vector3


Target = VelocityTarget | PositionTarget


@value
class Refusal:
    """A setpoint that is not flown; ArduPilot stops without a word, PX4 goes on and complains."""

    text: str = ""
    stops: bool = False


@value
class Sources:
    """What the estimator is built on, as the parameters choose."""

    flow: bool
    """Velocity from the optical flow sensor that the vehicle has."""
    outside_position: bool = False
    outside_velocity: bool = False
    outside_yaw: bool = False
    """Out of messages such as ODOMETRY (331) and VISION_POSITION_ESTIMATE (102)."""

    @property
    def needs_outside(self) -> bool:
        """Without messages there is no position."""
        return not self.flow and (self.outside_position or self.outside_velocity)


@value
class Condition:
    """What failsafes look at; ages in seconds, infinite for what was never heard."""

    flying: bool
    unaided_s: float
    """How long the estimator has had nothing to tell it how it moves."""
    battery: float
    """Share left."""
    battery_v: float
    ground_station_age_s: float
    onboard_computer_age_s: float


@value
class EstimatorHealth:
    """What the estimator's status messages tell."""

    settled: bool
    has_position: bool
    sources: Sources
    outside_age_s: float
    """Since a pose came from outside; infinite if none ever did."""
    is_at_rest: bool = False
    """It stands on the ground."""
    has_origin: bool = False
    """SET_GPS_GLOBAL_ORIGIN (48) has come."""


ParameterValues = Mapping[str, float]


@value
class Failsafe:
    """Something that may go wrong in flight, and what the autopilot then says and does."""

    fails: Callable[[Condition, ParameterValues], bool]
    texts: tuple[str, ...]
    cleared: str = ""
    mode: Callable[[ParameterValues], int | None] = lambda parameters: None
    """The mode that it changes to; None: it only tells."""


class EmulatedFirmware(Protocol):
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
    request_refused: int
    """MAV_RESULT of a REQUEST_MESSAGE (512) of what there is not, or not yet."""
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
    """Without a stream of setpoints it neither arms in its offboard mode nor enters it armed."""
    acknowledges_modes_at_once: bool
    """DO_SET_MODE is acknowledged when it comes, and once more when it is done or refused."""
    text_habit: TextHabit
    forwards_components: bool
    """What the vehicle's other components tell everybody goes out on all other links."""
    lifts_off_by_setpoint: bool
    beats_on_mode_change: bool
    """A HEARTBEAT tells a new mode at once; otherwise the next of each second."""
    returns_to_offboard: bool
    """When setpoints come again, out of the mode to which it had gone for want of them."""
    least_interval_us: int
    """What is asked for more often than this is refused."""
    interval_refused: int
    """MAV_RESULT of a refused SET_MESSAGE_INTERVAL (511)."""
    response: Response
    """How it flies."""
    capabilities: int
    flight_sw_version: int
    pose_messages: PoseMessages
    """Those about its pose that are understood."""
    position_needs_origin: bool
    """There is no position before SET_GPS_GLOBAL_ORIGIN (48)."""
    outside_lost_s: float
    """How long the position lives on after the last pose from outside."""
    force_skips_checks: bool
    origin_text: str
    """What is said when the origin comes; or nothing."""
    timesync_period_s: float
    failsafes: tuple[Failsafe, ...]
    healthy_unless_failed: int
    """Bits of SYS_STATUS that are healthy although nothing of the kind is there."""
    tells_highres_imu: bool
    """It has the better of the two messages about its gyro."""
    ground_truth: int
    """Id of the message that tells the true state, where it is told at all."""

    def behaviour(self, mode: int) -> Behaviour | None:
        """What a custom_mode does; None if there is no such mode."""
        ...

    def mode_of(self, main: int, sub: int) -> int:
        """The custom_mode that parameters 2 and 3 of DO_SET_MODE name."""
        ...

    def base_mode(self, mode: int, *, armed: bool) -> int: ...

    def no_such_mode(self, mode: int) -> str: ...

    def no_such_message(self, message_id: int) -> str:
        """What is said when an unknown message is asked for at an interval; or nothing."""
        ...

    def setpoint(
        self,
        message: Message,
        yaw_rad: float,
        position_ned_m: Vector3,
        parameters: ParameterValues,
    ) -> Target | Refusal:
        """What SET_POSITION_TARGET_LOCAL_NED (84) asks for, at this pose."""
        ...

    def setpoint_loss(self, parameters: ParameterValues) -> tuple[float, int | None]:
        """After how long without setpoints, and into which mode; None: it only brakes."""
        ...

    def sink_m_s(self, parameters: ParameterValues) -> float:
        """How fast it goes down with the throttle stick low, where that commands the climb."""
        ...

    def take_off_height_m(self, asked_m: float, parameters: ParameterValues) -> float: ...

    def sources(self, parameters: ParameterValues) -> Sources: ...

    def needs_origin(self, mode: int) -> bool:
        """Arming in this mode is refused until SET_GPS_GLOBAL_ORIGIN (48) has come."""
        ...

    def needs_position(self, mode: int) -> bool: ...

    def accepts_origin(self, place: Place) -> bool: ...

    def peripheral_complaint(
        self, outside: Outside, now_s: float, parameters: ParameterValues
    ) -> str:
        """What keeps it from arming that the parameters have told it to expect; or nothing."""
        ...

    def denial(self, complaint: str, *, arming: bool) -> tuple[str, ...]:
        """The STATUSTEXTs of refused arming, or of a failed check."""
        ...

    def estimator_status(self, boot_us: int, health: EstimatorHealth) -> Message: ...

    def distance_echoes(
        self, outside: Outside, now_s: float, parameters: ParameterValues
    ) -> list[Message]:
        """DISTANCE_SENSOR (132) as it is passed on to those who ask for it."""
        ...

    def true_state(self, truth: TrueState) -> Message:
        """Where it really is, as a simulated autopilot tells it."""
        ...


def boot_values(firmware: EmulatedFirmware, parameters: Mapping[str, float]) -> dict[str, float]:
    """What its parameters hold at the start."""
    return initial_values(firmware.table, {**firmware.configured, **parameters})


def system_id(firmware: EmulatedFirmware, values: Mapping[str, float]) -> int:
    """The MAVLink system that it is from its start on; 1 if the parameter holds none."""
    asked = int(values[firmware.system_id_parameter])
    return asked if 1 <= asked <= 255 else 1

"""Interface to the differences between autopilots; `core` uses nothing else of them."""

import enum
from collections.abc import Callable, Mapping
from typing import Protocol

from companion.core.frames import Vector3
from companion.core.values import value
from sitl.autopilot.estimation.external_messages import ExternalMessages, ExternalPoseMessages
from sitl.autopilot.estimation.ground_truth import Place
from sitl.autopilot.messages import TextHabit
from sitl.autopilot.parameters.protocol import Parameters
from sitl.autopilot.parameters.table import Table, initial_values
from sitl.autopilot.response import Response
from sitl.autopilot.streams import Message
from sitl.core.truth import TrueState


class Behaviour(enum.Enum):
    """Behaviour of a mode, independent of its name."""

    HOLD = "holds its position, independent of the sticks"
    CLIMB_BY_STICK = "holds; the throttle stick commands the climb, below its middle the descent"
    THRUST_BY_STICK = "the throttle stick commands the thrust"
    OFFBOARD = "follows setpoints"
    TAKE_OFF = "climbs to a height, then holds"
    LAND = "descends and disarms"


class Throttle(enum.StrEnum):
    """Position of the pilot's throttle stick."""

    LOW = "low"
    MID = "mid"


@value
class VelocityTarget:
    """An accepted velocity setpoint in the autopilot's estimated NED frame.

    With neither yaw nor yaw rate, the firmware selects the heading.
    """

    velocity_ned_m_s: Vector3
    yaw_rate_rad_s: float | None = None
    yaw_rad: float | None = None


@value
class PositionTarget:
    """A position setpoint in the autopilot's estimated NED frame. The nose turns to it."""

    position_ned_m: Vector3


Target = VelocityTarget | PositionTarget


@value
class Refusal:
    """A rejected setpoint. ArduPilot stops without a text; PX4 continues and sends a text."""

    text: str = ""
    stops: bool = False


@value
class Sources:
    """Inputs of the estimator, as the parameters select them."""

    flow: bool
    """Velocity from the vehicle's own optical flow sensor."""
    outside_position: bool = False
    outside_velocity: bool = False
    outside_yaw: bool = False
    """These three: from messages such as ODOMETRY (331) and VISION_POSITION_ESTIMATE (102)."""

    @property
    def needs_outside(self) -> bool:
        """There is no position without external messages."""
        return not self.flow and (self.outside_position or self.outside_velocity)


@value
class Condition:
    """Inputs of the failsafes. Ages in s, infinite if never received."""

    flying: bool
    unaided_s: float
    """Time for which the estimator has had no motion input."""
    battery: float
    """Remaining charge, 0 to 1."""
    battery_v: float
    ground_station_age_s: float
    onboard_computer_age_s: float


@value
class EstimatorHealth:
    """Inputs of the estimator's status messages."""

    settled: bool
    has_position: bool
    sources: Sources
    outside_age_s: float
    """Age of the last external pose, s; infinite if there was none."""
    is_at_rest: bool = False
    """The vehicle is on the ground at rest."""
    has_origin: bool = False
    """SET_GPS_GLOBAL_ORIGIN (48) was received."""


ParameterValues = Mapping[str, float]


@value
class Failsafe:
    """A failure condition in flight, with the autopilot's texts and reaction."""

    fails: Callable[[Condition, ParameterValues], bool]
    texts: tuple[str, ...]
    cleared: str = ""
    mode: Callable[[ParameterValues], int | None] = lambda parameters: None
    """The mode to change to; None: the autopilot only sends the texts."""


class EmulatedFirmware(Protocol):
    """One kind of autopilot."""

    autopilot: int
    """HEARTBEAT.autopilot."""
    boot_mode: int
    land_mode: int
    take_off_mode: int | None
    """The mode that NAV_TAKEOFF enters; None if it climbs within its offboard mode."""
    hold_mode: int
    """Mode that follows the take-off mode."""
    refused: int
    """MAV_RESULT of rejected arming, disarming and modes."""
    request_refused: int
    """MAV_RESULT of a REQUEST_MESSAGE (512) for a message that is not available."""
    streams_hz: dict[int, float]
    """Messages that are streamed without a request, with their rates."""
    more_streams_hz: dict[int, float]
    """The same for all links but the first, which is the companion's."""
    table: Table
    """Parameters with the firmware's defaults."""
    configured: dict[str, float]
    """Parameters of this vehicle that differ from the defaults, for flight without GPS."""
    parameter_protocol: type[Parameters]
    system_id_parameter: str
    """System id parameter, read at the start only."""
    setpoints_before_offboard: bool
    """Arming in offboard mode, and entering it armed, needs a stream of setpoints."""
    acknowledges_modes_at_once: bool
    """DO_SET_MODE is acknowledged on receipt and again with the final result."""
    text_habit: TextHabit
    forwards_components: bool
    """Broadcasts of the vehicle's other components are forwarded to all other links."""
    lifts_off_by_setpoint: bool
    heartbeat_on_mode_change: bool
    """A mode change sends a HEARTBEAT at once; otherwise the periodic HEARTBEAT reports it."""
    returns_to_offboard: bool
    """When setpoints resume, the autopilot returns from the setpoint timeout's mode."""
    min_interval_us: int
    """Shortest message interval, µs; shorter requests are rejected."""
    interval_refused: int
    """MAV_RESULT of a rejected SET_MESSAGE_INTERVAL (511)."""
    response: Response
    """Response of vehicle and setpoint shaping."""
    capabilities: int
    flight_sw_version: int
    pose_messages: ExternalPoseMessages
    """Accepted messages with a pose."""
    position_needs_origin: bool
    """The position is valid only after SET_GPS_GLOBAL_ORIGIN (48)."""
    outside_lost_s: float
    """Time after the last external pose at which the position becomes invalid, s."""
    force_skips_checks: bool
    origin_text: str
    """Text sent when the origin is set; may be empty."""
    timesync_period_s: float
    failsafes: tuple[Failsafe, ...]
    healthy_unless_failed: int
    """Bits of SYS_STATUS that report "healthy" without such a sensor."""
    sends_highres_imu: bool
    """HIGHRES_IMU is available besides SCALED_IMU."""
    ground_truth: int
    """Id of the message with the true state, where it is sent at all."""

    def behaviour(self, mode: int) -> Behaviour | None:
        """Behaviour of a custom_mode; None if there is no such mode."""
        ...

    def mode_of(self, main: int, sub: int) -> int:
        """The custom_mode for parameters 2 and 3 of DO_SET_MODE."""
        ...

    def base_mode(self, mode: int, *, armed: bool) -> int: ...

    def no_such_mode(self, mode: int) -> str: ...

    def no_such_message(self, message_id: int) -> str:
        """Text for an interval request of an unknown message; may be empty."""
        ...

    def setpoint(
        self,
        message: Message,
        yaw_rad: float,
        position_ned_m: Vector3,
        parameters: ParameterValues,
    ) -> Target | Refusal:
        """Decode SET_POSITION_TARGET_LOCAL_NED (84) at this pose."""
        ...

    def setpoint_loss(self, parameters: ParameterValues) -> tuple[float, int | None]:
        """Setpoint timeout, s, and the mode that it enters; None: the vehicle only brakes."""
        ...

    def sink_m_s(self, parameters: ParameterValues) -> float:
        """Descent rate with the throttle stick low, m/s, in modes where it commands the climb."""
        ...

    def take_off_height_m(self, asked_m: float, parameters: ParameterValues) -> float: ...

    def sources(self, parameters: ParameterValues) -> Sources: ...

    def needs_origin(self, mode: int) -> bool:
        """Arming in this mode is rejected until SET_GPS_GLOBAL_ORIGIN (48) is received."""
        ...

    def needs_position(self, mode: int) -> bool: ...

    def accepts_origin(self, place: Place) -> bool: ...

    def peripheral_failure(
        self, outside: ExternalMessages, now_s: float, parameters: ParameterValues
    ) -> str:
        """The reason against arming from a sensor that the parameters require; may be empty."""
        ...

    def denial(self, failure: str, *, arming: bool) -> tuple[str, ...]:
        """STATUSTEXTs of rejected arming or of a failed check."""
        ...

    def estimator_status(self, boot_us: int, health: EstimatorHealth) -> Message: ...

    def distance_echoes(
        self, outside: ExternalMessages, now_s: float, parameters: ParameterValues
    ) -> list[Message]:
        """Received DISTANCE_SENSOR (132) messages as they are forwarded to other clients."""
        ...

    def true_state(self, truth: TrueState) -> Message:
        """The true state as a simulated autopilot sends it."""
        ...


def boot_values(firmware: EmulatedFirmware, parameters: Mapping[str, float]) -> dict[str, float]:
    """Parameter values at the start."""
    return initial_values(firmware.table, {**firmware.configured, **parameters})


def system_id(firmware: EmulatedFirmware, values: Mapping[str, float]) -> int:
    """MAVLink system id from the start on; 1 if the parameter is out of range."""
    asked = int(values[firmware.system_id_parameter])
    return asked if 1 <= asked <= 255 else 1

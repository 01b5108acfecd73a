"""The values that the stages of a flight hand to each other.

All frozen, all SI and radians, local NED and body FRD as in `frames`. `time_s` is the flight's
own clock, which may be virtual.
"""

import enum
import math
from collections.abc import Mapping
from typing import Protocol

from companion.core.frames import Vector2, Vector3, wrap_rad
from companion.core.values import value


class Beam(enum.StrEnum):
    """Where a range sensor looks, in body FRD."""

    FRONT = "front"
    RIGHT = "right"
    BACK = "back"
    LEFT = "left"
    UP = "up"
    DOWN = "down"

    __hash__ = str.__hash__
    """Readings are looked up by beam all the time, and an enum's own hash is slow."""


BEARING_FRD_RAD: Mapping[Beam, float] = {
    Beam.FRONT: 0.0,
    Beam.RIGHT: math.pi / 2,
    Beam.BACK: math.pi,
    Beam.LEFT: -math.pi / 2,
}
"""Where the level beams look, clockwise from the nose."""


class RangeState(enum.Enum):
    """What a range sensor has to say; the five never look alike."""

    DISTANCE = "distance"
    NOTHING = "nothing in range"
    TOO_NEAR = "too near"
    STALE = "stale"
    FAILED = "failed"


@value
class RangeReading:
    """One range: a distance with its variance, or the reason why there is none.

    `distance_m` and `variance_m2` are NaN unless `state` is DISTANCE; of what is TOO_NEAR,
    `distance_m` may be a guess, not fit for a map.
    """

    state: RangeState
    distance_m: float = float("nan")
    variance_m2: float = float("nan")
    raw: float = float("nan")
    """What the sensor itself put out, in its own unit, if that says more than the distance."""

    @property
    def is_distance(self) -> bool:
        return self.state is RangeState.DISTANCE

    @property
    def is_alive(self) -> bool:
        """The sensor answered, whatever it saw."""
        return self.state not in (RangeState.STALE, RangeState.FAILED)


class RangeModel(Protocol):
    """What is known of a kind of range sensor."""

    @property
    def min_m(self) -> float: ...

    @property
    def max_m(self) -> float: ...

    @property
    def gain_sigma(self) -> float:
        """What calibration leaves of the unit's gain error, relative; part of `sigma_m`."""
        ...

    @property
    def mean_age_s(self) -> float:
        """How old a reading is on average: half the time between two fresh ones."""
        ...

    def sigma_m(self, distance_m: float) -> float:
        """Standard deviation of a reading at a true distance."""
        ...

    def alias_m(self, distance_m: float) -> float | None:
        """The distance below its least one at which it reads the same; None if there is none."""
        ...


@value
class RangeUnit:
    """One range sensor on the drone."""

    model: RangeModel
    bearing_frd_rad: float
    """Where its beam points, clockwise from the nose."""
    offset_m: float
    """From the drone's centre to the sensor, along its beam."""


@value
class RangeScan:
    """One sweep over all range sensors."""

    time_s: float
    readings: Mapping[Beam, RangeReading]


@value
class GyroSample:
    """Body rate about the down axis, clockwise positive, bias not removed."""

    time_s: float
    yaw_rate_rad_s: float
    turn_variance_rad2: float = 0.0
    """Of the turn since the sample before, beside the gyro's own noise: it was bridged."""


@value
class Odometry:
    """The autopilot's own estimate in its own drifting local NED frame.

    From LOCAL_POSITION_NED (32) and ATTITUDE (30), carried to `time_s`.
    """

    time_s: float
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    yaw_rad: float
    follows_us: bool = False
    """The autopilot is told our pose: its heading knows nothing that we did not say."""
    pulled_rad: float = 0.0
    """So far in all its estimator has pulled `yaw_rad` beyond what its rates add up to."""

    @property
    def turned_rad(self) -> float:
        """What its rates add up to, but for whole turns: how it has turned, not where north is."""
        return wrap_rad(self.yaw_rad - self.pulled_rad)


class LandedState(enum.Enum):
    """EXTENDED_SYS_STATE (245) landed_state."""

    UNKNOWN = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKING_OFF = 3
    LANDING = 4


LINK_SILENT_S = 1.0
JUST_TOLD_S = 0.1
"""Two ticks of the control loop."""


@value
class VehicleState:
    """What the link knows of the autopilot at this moment."""

    connected: bool = False
    silent_s: float = float("inf")
    """How long nothing at all has been heard from it."""
    unfit: str = ""
    """Why what is heard there is not flown, and what to do; empty: nothing against it."""
    mode: str = ""
    mode_age_s: float = 0.0
    """How long ago a HEARTBEAT has told the mode, and whether it is armed."""
    in_offboard_mode: bool = False
    """The mode in which the autopilot follows our setpoints: GUIDED or OFFBOARD."""
    left_offboard: bool = False
    """Since the last look at it, it has left that mode, even if it is back in it by now."""
    takes_off_by_setpoint: bool = False
    """It lifts off by a climbing setpoint (PX4) rather than by a command (ArduPilot)."""
    armed: bool = False
    landed_state: LandedState = LandedState.UNKNOWN
    estimate_ready: bool = False
    """The autopilot claims a usable position and sends it."""
    waits_for: str = ""
    """Why not, in words."""
    refusal: str = ""
    """The latest reason why a command was refused, in the autopilot's own words."""
    is_refused: bool = False
    """The command that was asked for last has got no answer but refusals."""
    battery: float | None = None
    """Share left, 0 to 1; None: it does not tell."""

    @property
    def is_silent(self) -> bool:
        """For longer than messages are lost by chance."""
        return self.silent_s > LINK_SILENT_S

    @property
    def is_mode_recent(self) -> bool:
        """So lately that a pilot's change since then is unlikely."""
        return self.mode_age_s <= JUST_TOLD_S


def is_ours(vehicle: VehicleState) -> bool:
    """It flies, and follows us."""
    return vehicle.armed and vehicle.in_offboard_mode


@value
class Fault:
    """Something is not well: the drone holds, and lands if it lasts."""

    text: str
    lasts_s: float
    """So long it is borne."""


@value
class Pose:
    """The companion's own estimate, local NED."""

    time_s: float
    north_m: float
    east_m: float
    down_m: float
    yaw_rad: float
    position_sigma_m: float = 0.0
    yaw_sigma_rad: float = 0.0
    reset_counter: int = 0
    """One more each time that the pose has been set right by a step."""

    @property
    def ne_m(self) -> Vector2:
        """North and east."""
        return self.north_m, self.east_m

    @property
    def height_m(self) -> float:
        """Above the take-off point."""
        return -self.down_m


@value
class Setpoint:
    """Velocity in body FRD and yaw rate; what the drone is asked to do until the next one."""

    forward_m_s: float = 0.0
    right_m_s: float = 0.0
    down_m_s: float = 0.0
    yaw_rate_rad_s: float = 0.0


HOLD = Setpoint()
FIRST_LAG_S = 0.6
"""How long a drone goes on at its velocity when it is stopped, until that has been learnt: between
ArduCopter 4.6 and PX4 1.17 (docs/autopilot.md)."""


class CommandKind(enum.Enum):
    """What the companion may ask of the autopilot besides setpoints."""

    OFFBOARD_MODE = "follow setpoints"
    ARM = "arm"
    TAKE_OFF = "take off"
    LAND = "land"
    DISARM = "disarm"


@value
class Command:
    kind: CommandKind
    height_m: float = 0.0
    """For TAKE_OFF: above the ground."""


class Task(enum.Enum):
    """What a script may order, step by step."""

    WAIT = "wait"
    TAKE_OFF = "take off"
    SCAN = "scan"
    HOME = "return to the start"
    LAND = "land"


@value
class Order:
    """One step of a script; a higher number is a new one."""

    number: int = 0
    task: Task = Task.WAIT
    mission: str = ""
    """Which mission is scanned by; empty: the configuration's."""


@value
class Hit:
    """A point where a beam met something, local NED, with the variance along the beam."""

    time_s: float
    beam: Beam
    position_ned_m: Vector3
    variance_m2: float
    wall: int | None = None
    """Which of the map's wall lines it is on, if any."""


@value
class WallLine:
    """A wall as the estimator knows it, local NED: {p : p·n = offset}, n = (cos, sin)(normal)."""

    normal_rad: float
    offset_m: float
    sigma_m: float
    """Of the offset, `anchor_m` along the wall, that is at p·t = anchor_m, t = (-sin, cos)(normal).
    There it does not depend on the error of the direction."""
    normal_sigma_rad: float = 0.0
    anchor_m: float = 0.0

    def sigma_at_m(self, along_m: float) -> float:
        """Across the wall, at a place along it."""
        return math.hypot(self.sigma_m, (along_m - self.anchor_m) * self.normal_sigma_rad)


@value
class WallSegment:
    """A straight piece of wall seen from above, local NED (north, east)."""

    start_ne_m: Vector2
    end_ne_m: Vector2
    sigma_m: float
    """Standard deviation across the wall, at its middle."""
    hits: int
    normal_sigma_rad: float = 0.0
    """Of its direction."""

    @property
    def length_m(self) -> float:
        return math.dist(self.start_ne_m, self.end_ne_m)


@value
class Surface:
    """Something level above the floor, such as a table top, local NED."""

    centre_ne_m: Vector2
    height_m: float
    """Above the take-off point."""
    area_m2: float
    """So much of it was seen."""


@value
class FloorPlan:
    """The map: walls, the points they were fitted to, the path flown, and heights.

    `ceiling_m` and `floor_m` are above the take-off point; None if no beam ever met one.
    """

    walls: tuple[WallSegment, ...] = ()
    hits: tuple[Hit, ...] = ()
    path: tuple[Pose, ...] = ()
    ceiling_m: float | None = None
    floor_m: float | None = None
    tops: tuple[Surface, ...] = ()


@value
class Sketch:
    """The map so far, for the eye: thinned out to what can be sent and drawn every second."""

    walls: tuple[WallSegment, ...] = ()
    points_ned_m: tuple[Vector3, ...] = ()
    """Where beams have met something."""
    path_ned_m: tuple[Vector3, ...] = ()
    ceiling_m: float | None = None
    """Above the take-off point."""

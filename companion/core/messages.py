"""Messages between the stages of a flight.

All are frozen, in SI units and radians, in the frames local NED and body FRD of `frames`. `time_s`
is the flight's own clock, which may be virtual.
"""

import enum
import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Protocol

from companion.core.frames import Vector2, Vector3, wrap_rad
from companion.core.values import value


class Beam(enum.StrEnum):
    """Direction of a range sensor's beam, in body FRD."""

    FRONT = "front"
    RIGHT = "right"
    BACK = "back"
    LEFT = "left"
    UP = "up"
    DOWN = "down"

    __hash__ = str.__hash__
    """Readings are looked up by beam often, and an enum's own hash is slow."""


BEARING_FRD_RAD: Mapping[Beam, float] = {
    Beam.FRONT: 0.0,
    Beam.RIGHT: math.pi / 2,
    Beam.BACK: math.pi,
    Beam.LEFT: -math.pi / 2,
}
"""Bearings of the level beams, clockwise from the nose, rad."""


class RangeState(enum.Enum):
    """Result of a range measurement; the five states are distinct."""

    DISTANCE = "distance"
    NOTHING = "nothing in range"
    TOO_NEAR = "too near"
    STALE = "stale"
    FAILED = "failed"


@value
class RangeReading:
    """One range reading: a distance with its variance, or the state without one.

    `distance_m` and `variance_m2` are NaN unless `state` is DISTANCE. With TOO_NEAR, `distance_m`
    may be a rough estimate that is not fit for a map.
    """

    state: RangeState
    distance_m: float = float("nan")
    variance_m2: float = float("nan")
    raw: float = float("nan")
    """Raw output of the sensor in its own unit, if it contains more than the distance."""

    @property
    def is_distance(self) -> bool:
        return self.state is RangeState.DISTANCE

    @property
    def is_alive(self) -> bool:
        """True if the sensor answered, with or without a distance."""
        return self.state not in (RangeState.STALE, RangeState.FAILED)


STALE = RangeReading(RangeState.STALE)
"""Reading in place of one of which nothing is known, although the sensor works."""


class RangeModel(Protocol):
    """Measurement model of a type of range sensor."""

    @property
    def min_m(self) -> float: ...

    @property
    def max_m(self) -> float: ...

    @property
    def gain_sigma(self) -> float:
        """Relative sigma of the unit's gain error after calibration; part of `sigma_m`."""
        ...

    @property
    def mean_age_s(self) -> float:
        """Mean age of a reading: half the interval between two measurements."""
        ...

    def sigma_m(self, distance_m: float) -> float:
        """Standard deviation of a reading at a true distance."""
        ...

    def alias_m(self, distance_m: float) -> float | None:
        """The distance below the least one that gives the same reading; None if there is none."""
        ...


@value
class RangeUnit:
    """One range sensor on the drone."""

    model: RangeModel
    bearing_frd_rad: float
    """Bearing of its beam, clockwise from the nose."""
    offset_m: float
    """Distance from the drone's centre to the sensor, along its beam."""


@value
class RangeScan:
    """One reading of all range sensors."""

    time_s: float
    readings: Mapping[Beam, RangeReading]


@value
class GyroSample:
    """Body rate about the down axis, clockwise positive, bias not removed."""

    time_s: float
    yaw_rate_rad_s: float
    turn_variance_rad2: float = 0.0
    """Additional variance of the turn since the last sample, if a gap was bridged."""


@value
class Odometry:
    """The autopilot's own estimate in its own drifting local NED frame.

    From LOCAL_POSITION_NED (32) and ATTITUDE (30), extrapolated to `time_s`.
    """

    time_s: float
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    yaw_rad: float
    follows_us: bool = False
    """The autopilot receives our pose, so its heading contains no information of its own."""
    pulled_rad: float = 0.0
    """Sum of the estimator's corrections of `yaw_rad` beyond its integrated rates."""

    @property
    def turned_rad(self) -> float:
        """Integral of its rates except for whole turns: a turn, not a direction to north."""
        return wrap_rad(self.yaw_rad - self.pulled_rad)


class LandedState(enum.Enum):
    """EXTENDED_SYS_STATE (245) landed_state."""

    UNKNOWN = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKING_OFF = 3
    LANDING = 4


LINK_SILENT_S = 1.0
"""A longer silence is a lost link, not random message loss, s. Chosen."""
RECENT_MODE_S = 0.1
"""A mode report is recent within this time, s: two ticks of the control loop."""


@value
class VehicleState:
    """State of the autopilot as the link reports it."""

    connected: bool = False
    silent_s: float = float("inf")
    """Time since the last message of any kind."""
    unfit: str = ""
    """Reason not to fly with this autopilot, and the remedy; empty if there is none."""
    mode: str = ""
    mode_age_s: float = 0.0
    """Time since the last HEARTBEAT, which reports mode and armed state."""
    in_offboard_mode: bool = False
    """True in the mode that follows our setpoints: GUIDED or OFFBOARD."""
    left_offboard: bool = False
    """It has left that mode since the last tick, even if it has returned to it."""
    takes_off_by_setpoint: bool = False
    """Take-off is by a climbing setpoint (PX4), not by a command (ArduPilot)."""
    armed: bool = False
    landed_state: LandedState = LandedState.UNKNOWN
    estimate_ready: bool = False
    """The autopilot reports a usable position estimate and sends it."""
    waits_for: str = ""
    """Text of the reason if it does not."""
    refusal: str = ""
    """Latest reason for a refused command, as the autopilot's text."""
    is_refused: bool = False
    """The last command has received refusals only."""
    battery: float | None = None
    """Remaining share, 0 to 1; None if not reported."""

    @property
    def is_silent(self) -> bool:
        """True if the silence exceeds random message loss."""
        return self.silent_s > LINK_SILENT_S

    @property
    def is_mode_recent(self) -> bool:
        """True if the mode report is so recent that the pilot has hardly changed it since."""
        return self.mode_age_s <= RECENT_MODE_S


def is_ours(vehicle: VehicleState) -> bool:
    """True if the vehicle is armed and follows our setpoints."""
    return vehicle.armed and vehicle.in_offboard_mode


@value
class Fault:
    """A fault: the drone holds, and lands if the fault lasts."""

    text: str
    lasts_s: float
    """Time after which the drone lands."""


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
    """Incremented with each step of the pose by a correction."""

    @property
    def ne_m(self) -> Vector2:
        """North and east."""
        return self.north_m, self.east_m

    @property
    def height_m(self) -> float:
        """Height above the take-off point."""
        return -self.down_m


@value
class Setpoint:
    """Velocity in body FRD and yaw rate, valid until the next setpoint."""

    forward_m_s: float = 0.0
    right_m_s: float = 0.0
    down_m_s: float = 0.0
    yaw_rate_rad_s: float = 0.0


HOLD = Setpoint()
"""The setpoint to hover in place."""
FIRST_LAG_S = 0.6
"""Initial lag of the velocity response, s, until it has been estimated: between those of ArduCopter
4.6 and PX4 1.17 (docs/autopilot.md)."""


class CommandKind(enum.Enum):
    """Commands to the autopilot besides setpoints."""

    OFFBOARD_MODE = "follow setpoints"
    ARM = "arm"
    TAKE_OFF = "take off"
    LAND = "land"
    DISARM = "disarm"


@value
class Command:
    kind: CommandKind
    height_m: float = 0.0
    """Height above the ground for TAKE_OFF."""


@value
class Hit:
    """End of a beam on an obstacle, local NED, with the variance along the beam."""

    time_s: float
    beam: Beam
    position_ned_m: Vector3
    variance_m2: float
    wall: int | None = None
    """Index of its wall line in the map, if any."""


@value
class WallLine:
    """A wall of the estimator, local NED: {p : p·n = offset}, n = (cos, sin)(normal)."""

    normal_rad: float
    offset_m: float
    sigma_m: float
    """Sigma of the offset at `anchor_m` along the wall, at p·t = anchor_m, t = (-sin, cos)(normal).
    There it is independent of the error of the direction."""
    normal_sigma_rad: float = 0.0
    anchor_m: float = 0.0

    def sigma_at_m(self, along_m: float) -> float:
        """Sigma across the wall at a position along it."""
        return math.hypot(self.sigma_m, (along_m - self.anchor_m) * self.normal_sigma_rad)


@value
class WallSegment:
    """A straight piece of wall in the plan view, local NED (north, east)."""

    start_ne_m: Vector2
    end_ne_m: Vector2
    sigma_m: float
    """Standard deviation across the wall, at its middle."""
    hits: int
    normal_sigma_rad: float = 0.0
    """Sigma of its direction."""

    @property
    def length_m(self) -> float:
        return math.dist(self.start_ne_m, self.end_ne_m)


@value
class Surface:
    """A level surface above the floor, such as a table top, local NED."""

    centre_ne_m: Vector2
    height_m: float
    """Height above the take-off point."""
    area_m2: float
    """Measured part of its area."""


@value
class FloorPlan:
    """The map: walls, the points they were fitted to, the path flown, and heights.

    `ceiling_m` and `floor_m` are above the take-off point; None if not measured.
    """

    walls: tuple[WallSegment, ...] = ()
    hits: tuple[Hit, ...] = ()
    path: tuple[Pose, ...] = ()
    ceiling_m: float | None = None
    floor_m: float | None = None
    tops: tuple[Surface, ...] = ()
    begins: tuple[int, ...] = (0,)
    """Index in `path` at which each flight of a joint map begins."""

    @property
    def paths(self) -> tuple[tuple[Pose, ...], ...]:
        """The path of each flight."""
        return tuple(self.path[a:b] for a, b in pairwise((*self.begins, len(self.path))))


@value
class Sketch:
    """A reduced map for display, small enough to send and draw every second."""

    walls: tuple[WallSegment, ...] = ()
    points_ned_m: tuple[Vector3, ...] = ()
    """Ends of beams on obstacles."""
    path_ned_m: tuple[Vector3, ...] = ()
    ceiling_m: float | None = None
    """Height above the take-off point."""
    earlier_walls: tuple[WallSegment, ...] = ()
    """Walls that earlier flights of the survey have mapped."""

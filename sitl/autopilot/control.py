"""What velocity the autopilot flies at this moment, in its own estimated frame.

GROUND ──take-off──► CLIMB ──at height──► HOLD ◄──setpoint timeout── FOLLOW
│                   │ ──setpoint────────────────►│
└───────────────────┴──────── LAND ◄─────────────┘
│ on the ground
▼
GROUND, disarmed

in the air, the throttle stick low in a pilot's mode:   SINK, FALL ──on the ground──► GROUND, armed
"""

import enum
import math

from companion.frames import Vector3, wrap_rad
from sitl.autopilot.estimator import Estimator
from sitl.autopilot.personality import PositionTarget, Target, VelocityTarget
from sitl.vehicle import BRAKING_M_S2, STEP_S

CLIMB_DELAY_S = 1.0
"""ArduCopter spins its motors up first."""
CLIMB_M_S = 1.2
LAND_M_S = 0.5
POSITION_GAIN_1_S = 0.8
MOST_HOLD_M_S = 0.5
AT_HEIGHT_M = 0.1
CRUISE_M_S = 5.0
"""To a position."""
APPROACH_M_S2 = 1.0
YAW_GAIN_1_S = 3.0
MOST_YAW_RATE_RAD_S = math.radians(67)
"""Turning to a commanded heading, as measured."""
COURSE_FROM_M_S = 0.5
"""From this speed on the nose is turned to the course where no yaw is commanded."""
DETECT_LANDING_S = 1.0


class Manoeuvre(enum.Enum):
    """Where in the diagram above."""

    GROUND = "on the ground"
    CLIMB = "taking off"
    HOLD = "holding its position"
    FOLLOW = "following setpoints"
    LAND = "landing"
    SINK = "sinking, with the throttle stick low"
    FALL = "falling, with its motors at idle"


class Control:
    """The manoeuvre flown now, and the velocity it asks for."""

    def __init__(self, estimator: Estimator) -> None:
        self._estimator = estimator
        self.manoeuvre = Manoeuvre.GROUND
        self._since_s = 0.0
        self._height_m = 0.0
        self._hold_at: Vector3 | None = None
        self._braking: tuple[float, float] = (0.0, 0.0)
        self._target: Target = VelocityTarget((0.0, 0.0, 0.0), 0.0)
        self._on_ground_s = 0.0
        self._sink_m_s = 0.0

    def take_off(self, now_s: float, height_m: float) -> None:
        self.manoeuvre, self._since_s, self._height_m = Manoeuvre.CLIMB, now_s, height_m

    def land(self) -> None:
        """On the ground, too: it finds out, and disarms."""
        self._begin_hold()
        self.manoeuvre = Manoeuvre.LAND
        self._on_ground_s = 0.0

    def hold(self) -> None:
        """Brake, then stay: what every mode without a pilot's stick movement does."""
        if self.manoeuvre is not Manoeuvre.GROUND:
            self._begin_hold()

    def sink(self, down_m_s: float) -> None:
        """Brake and stay, but go down."""
        if self.manoeuvre is not Manoeuvre.GROUND:
            self._begin_hold()
            self.manoeuvre, self._sink_m_s = Manoeuvre.SINK, down_m_s

    def fall(self) -> None:
        if self.manoeuvre is not Manoeuvre.GROUND:
            self.manoeuvre = Manoeuvre.FALL

    def _begin_hold(self) -> None:
        if self.manoeuvre is not Manoeuvre.HOLD:
            self._braking = self._estimator.velocity_ned_m_s[:2]
            self._hold_at = None
        self.manoeuvre = Manoeuvre.HOLD

    def follow(self, target: Target) -> None:
        """A setpoint in the estimated NED."""
        self.manoeuvre = Manoeuvre.FOLLOW
        self._target = target

    def stop(self) -> None:
        self.manoeuvre = Manoeuvre.GROUND

    def wanted(self, now_s: float, *, on_ground: bool) -> tuple[Vector3, float]:
        """Velocity in the estimated NED and yaw rate; GROUND once it has landed."""
        match self.manoeuvre:
            case Manoeuvre.FOLLOW:
                return self._follow(self._target)
            case Manoeuvre.CLIMB:
                return self._climb(now_s), 0.0
            case Manoeuvre.HOLD:
                return self._stay(), 0.0
            case Manoeuvre.LAND:
                return self._descend(on_ground=on_ground), 0.0
            case Manoeuvre.SINK:
                self.manoeuvre = Manoeuvre.GROUND if on_ground else self.manoeuvre
                return (*self._stay()[:2], self._sink_m_s), 0.0
            case _:
                return (0.0, 0.0, 0.0), 0.0

    def _follow(self, target: Target) -> tuple[Vector3, float]:
        if isinstance(target, PositionTarget):
            velocity = self._towards(target.position_ned_m)
            return velocity, self._along(velocity)
        return target.velocity_ned_m_s, self._turn(target)

    def _towards(self, position_ned_m: Vector3) -> Vector3:
        """Straight there, slowing down in time."""
        off = [
            there - here
            for there, here in zip(position_ned_m, self._estimator.position_ned_m, strict=True)
        ]
        distance_m = math.hypot(*off)
        if distance_m == 0:
            return 0.0, 0.0, 0.0
        speed = min(
            CRUISE_M_S, math.sqrt(APPROACH_M_S2 * distance_m), POSITION_GAIN_1_S * distance_m
        )
        north, east, down = (speed / distance_m * value for value in off)
        return north, east, max(-CLIMB_M_S, min(CLIMB_M_S, down))

    def _turn(self, target: VelocityTarget) -> float:
        if target.yaw_rad is not None:
            return self._turn_to(target.yaw_rad)
        if target.yaw_rate_rad_s is not None:
            return target.yaw_rate_rad_s
        return self._along(target.velocity_ned_m_s)

    def _along(self, velocity_ned_m_s: Vector3) -> float:
        north, east, _ = velocity_ned_m_s
        if math.hypot(north, east) < COURSE_FROM_M_S:
            return 0.0
        return self._turn_to(math.atan2(east, north))

    def _turn_to(self, yaw_rad: float) -> float:
        rate = YAW_GAIN_1_S * wrap_rad(yaw_rad - self._estimator.yaw_rad)
        return max(-MOST_YAW_RATE_RAD_S, min(MOST_YAW_RATE_RAD_S, rate))

    def _climb(self, now_s: float) -> Vector3:
        if now_s - self._since_s < CLIMB_DELAY_S:
            return 0.0, 0.0, 0.0
        short_m = self._height_m + self._estimator.position_ned_m[2]
        if short_m < AT_HEIGHT_M:
            self._begin_hold()
        return 0.0, 0.0, -min(CLIMB_M_S, 1.2 * max(short_m, 0.0))

    def _stay(self) -> Vector3:
        """Ramp the velocity down, then hold the position where the drone came to rest."""
        speed = math.hypot(*self._braking)
        if speed > BRAKING_M_S2 * STEP_S:
            share = 1 - BRAKING_M_S2 * STEP_S / speed
            self._braking = (self._braking[0] * share, self._braking[1] * share)
            return *self._braking, 0.0
        position = self._estimator.position_ned_m
        self._hold_at = self._hold_at or position
        velocity = [
            POSITION_GAIN_1_S * (there - here)
            for there, here in zip(self._hold_at, position, strict=True)
        ]
        north, east, down = (max(-MOST_HOLD_M_S, min(MOST_HOLD_M_S, v)) for v in velocity)
        return north, east, down

    def _descend(self, *, on_ground: bool) -> Vector3:
        self._on_ground_s = self._on_ground_s + STEP_S if on_ground else 0.0
        if self._on_ground_s >= DETECT_LANDING_S:
            self.manoeuvre = Manoeuvre.GROUND
        north, east, _ = self._stay()
        return north, east, LAND_M_S

"""Computes the velocity that the autopilot flies now, in its estimated NED frame.

GROUND ──take-off──► CLIMB ──at height──► HOLD ◄──setpoint timeout── FOLLOW
│                   │ ──setpoint────────────────►│
└───────────────────┴──────── LAND ◄─────────────┘
│ on the ground
▼
GROUND, disarmed

in the air, throttle stick low in a pilot's mode:   SINK, FALL ──on the ground──► GROUND, armed
"""

import enum
import math
from random import Random

from companion.core.frames import Vector2, Vector3, wrap_rad
from sitl.autopilot.estimation.estimator import AutopilotEstimator
from sitl.autopilot.firmware import PositionTarget, Target, VelocityTarget
from sitl.autopilot.response import Response
from sitl.core.vehicle import STEP_S

CLIMB_M_S = 1.2
"""Largest climb or descent rate on the way to a position setpoint, m/s."""
POSITION_GAIN_1_S = 0.8
"""Velocity per position error, 1/s."""
MAX_HOLD_M_S = 0.5
"""Largest velocity while holding a position, m/s."""
AT_REST_M_S = 0.1
"""Below this speed the vehicle holds its current position, m/s."""
AT_HEIGHT_M = 0.1
"""A take-off ends this far below its height, m."""
CRUISE_M_S = 5.0
"""Largest speed on the way to a position setpoint, m/s."""
APPROACH_M_S2 = 1.0
"""Squared speed per distance to a position setpoint, m/s²: twice the deceleration."""
YAW_GAIN_1_S = 3.0
"""Yaw rate per yaw error, 1/s."""
MAX_YAW_RATE_RAD_S = math.radians(67)
"""Yaw rate limit on the way to a commanded heading, rad/s. Measured."""
COURSE_FROM_M_S = 0.5
"""Speed above which the nose turns to the course if no yaw is commanded, m/s."""


class Manoeuvre(enum.Enum):
    """State in the diagram above."""

    GROUND = "on the ground"
    CLIMB = "taking off"
    HOLD = "holding its position"
    FOLLOW = "following setpoints"
    LAND = "landing"
    SINK = "sinking, with the throttle stick low"
    FALL = "falling, with its motors at idle"


class Control:
    """The current manoeuvre and the velocity that it commands."""

    def __init__(self, estimator: AutopilotEstimator, response: Response, random: Random) -> None:
        """`random` draws the horizontal drift of each landing."""
        self._estimator = estimator
        self._response = response
        self._random = random
        self.manoeuvre = Manoeuvre.GROUND
        self._lifts_s = 0.0
        self._height_m = 0.0
        self._hold_at: Vector3 | None = None
        self._target: Target = VelocityTarget((0.0, 0.0, 0.0), 0.0)
        self._on_ground_s = 0.0
        self._drift_ne_m_s: Vector2 = (0.0, 0.0)
        self._sink_m_s = 0.0

    def arm(self, now_s: float) -> None:
        """Start to spin up the motors."""
        self._lifts_s = now_s + self._response.spool_up_s

    def take_off(self, now_s: float, height_m: float) -> None:
        self.manoeuvre, self._height_m = Manoeuvre.CLIMB, height_m
        self._lifts_s = max(self._lifts_s, now_s + self._response.take_off_delay_s)

    def has_thrust(self, now_s: float) -> bool:
        """The motors have enough thrust to lift off."""
        return now_s >= self._lifts_s

    def land(self) -> None:
        """Start a landing, also on the ground: there it detects the ground and disarms."""
        self._begin_hold()
        self.manoeuvre = Manoeuvre.LAND
        self._on_ground_s = 0.0
        sigma_m_s = self._response.land_drift_m_s
        self._drift_ne_m_s = self._random.gauss(0, sigma_m_s), self._random.gauss(0, sigma_m_s)

    def hold(self) -> None:
        """Brake, then hold the position: the behaviour of all modes with released sticks."""
        if self.manoeuvre is not Manoeuvre.GROUND:
            self._begin_hold()

    def sink(self, down_m_s: float) -> None:
        """Brake and hold the horizontal position, but descend."""
        if self.manoeuvre is not Manoeuvre.GROUND:
            self._begin_hold()
            self.manoeuvre, self._sink_m_s = Manoeuvre.SINK, down_m_s

    def fall(self) -> None:
        if self.manoeuvre is not Manoeuvre.GROUND:
            self.manoeuvre = Manoeuvre.FALL

    def _begin_hold(self) -> None:
        if self.manoeuvre is not Manoeuvre.HOLD:
            self._hold_at = None
        self.manoeuvre = Manoeuvre.HOLD

    def follow(self, target: Target) -> None:
        """Follow a setpoint in the estimated NED frame."""
        self.manoeuvre = Manoeuvre.FOLLOW
        self._target = target

    def stop(self) -> None:
        self.manoeuvre = Manoeuvre.GROUND

    def wanted(self, *, on_ground: bool) -> tuple[Vector3, float]:
        """Velocity in the estimated NED frame, and yaw rate. Sets GROUND after a landing."""
        match self.manoeuvre:
            case Manoeuvre.FOLLOW:
                return self._follow(self._target)
            case Manoeuvre.CLIMB:
                return self._climb(), 0.0
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
        """Velocity straight to a position, reduced before it."""
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
        return max(-MAX_YAW_RATE_RAD_S, min(MAX_YAW_RATE_RAD_S, rate))

    def _climb(self) -> Vector3:
        response = self._response
        short_m = self._height_m + self._estimator.position_ned_m[2]
        if short_m < AT_HEIGHT_M:
            self._begin_hold()
        climb_m_s = response.take_off_gain_1_s * max(short_m, 0.0)
        return 0.0, 0.0, -min(response.take_off_m_s, climb_m_s)

    def _stay(self) -> Vector3:
        """Come to rest, then hold the position reached."""
        estimate = self._estimator
        position = estimate.position_ned_m
        if self._hold_at is None:
            if math.hypot(*estimate.velocity_ned_m_s[:2]) > AT_REST_M_S:
                return 0.0, 0.0, 0.0
            self._hold_at = position
        velocity = [
            POSITION_GAIN_1_S * (there - here)
            for there, here in zip(self._hold_at, position, strict=True)
        ]
        north, east, down = (max(-MAX_HOLD_M_S, min(MAX_HOLD_M_S, v)) for v in velocity)
        return north, east, down

    def _descend(self, *, on_ground: bool) -> Vector3:
        self._on_ground_s = self._on_ground_s + STEP_S if on_ground else 0.0
        if self._on_ground_s >= self._response.disarm_delay_s:
            self.manoeuvre = Manoeuvre.GROUND
        north, east, _ = self._stay()
        if self._hold_at is not None and not on_ground:
            drift_north, drift_east = self._drift_ne_m_s
            hold_north, hold_east, down = self._hold_at
            self._hold_at = hold_north + drift_north * STEP_S, hold_east + drift_east * STEP_S, down
            north, east = north + drift_north, east + drift_east
        return north, east, self._response.land_m_s

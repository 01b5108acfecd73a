"""What others tell the autopilot about the world, and how old that is.

DISTANCE_SENSOR, OBSTACLE_DISTANCE ─────────────────────────► ranges by orientation
ODOMETRY, VISION_POSITION_ESTIMATE, VISION_SPEED_ESTIMATE ──► a pose, as far as it is understood
HEARTBEAT ──────────────────────────────────────────────────► who is there
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import Vector3
from companion.core.values import value
from sitl.autopilot.streams import Message

RANGE_TIMEOUT_S = 0.5
AROUND = (0, 1, 2, 3, 4, 5, 6, 7, 24)
"""MAV_SENSOR_ORIENTATION of proximity sensors: eight around in steps of 45°, and up."""
DOWN = 25
NEVER = -math.inf
FARTHEST = 1e5


@value
class PoseMessages:
    """Which of the messages about the vehicle's pose an autopilot understands."""

    odometry_frames: tuple[int, ...]
    """MAV_FRAME of ODOMETRY (331)."""
    estimator_types: tuple[int, ...] | None = None
    """MAV_ESTIMATOR_TYPE of ODOMETRY; None: it does not look."""
    takes_vision_speed: bool = True
    """VISION_SPEED_ESTIMATE (103)."""


@value
class OutsidePose:
    """Where somebody else thinks the vehicle is; None: not told. NED, m, m/s, yaw from north."""

    position_ned_m: Vector3 | None = None
    velocity_ned_m_s: Vector3 | None = None
    yaw_rad: float | None = None
    reset_counter: int = 0


class Outside:
    """The latest of everything; time is an argument."""

    def __init__(self, understood: PoseMessages) -> None:
        self._understood = understood
        self.ranges: dict[int, tuple[float, Message]] = {}
        """By orientation: when it came, and DISTANCE_SENSOR (132)."""
        self._obstacles_s = NEVER
        self._pose: OutsidePose | None = None
        self._pose_s = NEVER
        self._ground_station_s = self._onboard_computer_s = NEVER

    def hear(self, message: Message, now_s: float) -> str:
        """Take in a message; what is none of the above changes nothing. The complaint, if any."""
        match message.get_type():
            case "DISTANCE_SENSOR":
                self.ranges[message.orientation] = now_s, message
            case "OBSTACLE_DISTANCE":
                self._obstacles_s = now_s
            case "VISION_POSITION_ESTIMATE":
                self._see(_position_estimate(message), now_s)
            case "VISION_SPEED_ESTIMATE" if self._understood.takes_vision_speed:
                self._see(OutsidePose(None, _finite((message.x, message.y, message.z))), now_s)
            case "ODOMETRY":
                return self._hear_odometry(message, now_s)
            case "HEARTBEAT":
                self._meet(message, now_s)
        return ""

    def _hear_odometry(self, message: Message, now_s: float) -> str:
        types = self._understood.estimator_types
        if types is not None and message.estimator_type not in types:
            return f"ODOMETRY: estimator_type {message.estimator_type} unsupported"
        if message.frame_id in self._understood.odometry_frames:
            self._see(_odometry(message), now_s)
        return ""

    def _meet(self, message: Message, now_s: float) -> None:
        if message.type == mavlink.MAV_TYPE_GCS:
            self._ground_station_s = now_s
        elif message.type == mavlink.MAV_TYPE_ONBOARD_CONTROLLER:
            self._onboard_computer_s = now_s

    def _see(self, pose: OutsidePose | None, now_s: float) -> None:
        """Position and velocity of one moment may come in two messages."""
        if pose is None or pose == OutsidePose(reset_counter=pose.reset_counter):
            return
        if self._pose is not None and pose.position_ned_m is None:
            pose = replace(self._pose, velocity_ned_m_s=pose.velocity_ned_m_s)
        elif self._pose is not None and pose.velocity_ned_m_s is None:
            pose = replace(pose, velocity_ned_m_s=self._pose.velocity_ned_m_s)
        self._pose, self._pose_s = pose, now_s

    def take_pose(self) -> OutsidePose | None:
        """What has come since the last call."""
        pose, self._pose = self._pose, None
        return pose

    def pose_age_s(self, now_s: float) -> float:
        return now_s - self._pose_s

    def ground_station_age_s(self, now_s: float) -> float:
        return now_s - self._ground_station_s

    def onboard_computer_age_s(self, now_s: float) -> float:
        return now_s - self._onboard_computer_s

    def has_range(self, orientation: int, now_s: float) -> bool:
        return orientation in self.fresh_ranges(now_s)

    def has_proximity(self, now_s: float) -> bool:
        fresh = any(o in AROUND for o in self.fresh_ranges(now_s))
        return fresh or now_s - self._obstacles_s <= RANGE_TIMEOUT_S

    def fresh_ranges(self, now_s: float) -> dict[int, Message]:
        """By orientation, those not older than 0.5 s."""
        return {message.orientation: message for _, message in self.fresh(now_s)}

    def fresh(self, now_s: float) -> list[tuple[float, Message]]:
        """The same, each with the time of its arrival."""
        return [told for told in self.ranges.values() if now_s - told[0] <= RANGE_TIMEOUT_S]


def _finite(vector: tuple[float, float, float]) -> Vector3 | None:
    """None for what is no vector, or beyond any building."""
    return vector if all(abs(value) <= FARTHEST for value in vector) else None  # false for NaN too


def _position_estimate(message: Message) -> OutsidePose:
    """VISION_POSITION_ESTIMATE (102): NED."""
    return OutsidePose(
        _finite((message.x, message.y, message.z)),
        None,
        message.yaw if math.isfinite(message.yaw) else None,
        message.reset_counter,
    )


def _odometry(message: Message) -> OutsidePose | None:
    """ODOMETRY (331): pose in a local frame, velocity in the body's."""
    if message.child_frame_id != mavlink.MAV_FRAME_BODY_FRD or message.quality < 0:
        return None
    yaw_rad = _yaw(message.q)
    velocity = _finite((message.vx, message.vy, message.vz))
    if velocity is not None and yaw_rad is not None:
        velocity = rotated(message.q, velocity)
    return OutsidePose(
        _finite((message.x, message.y, message.z)), velocity, yaw_rad, message.reset_counter
    )


def rotated(quaternion_wxyz: Sequence[float], vector_frd: Vector3) -> Vector3:
    """From the body's frame to the one that the quaternion is told in."""
    w, *axis = quaternion_wxyz
    once = _cross(axis, vector_frd)
    twice = _cross(axis, once)
    x, y, z = (v + 2 * (w * o + t) for v, o, t in zip(vector_frd, once, twice, strict=True))
    return x, y, z


def _cross(a: Sequence[float], b: Sequence[float]) -> Vector3:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _yaw(quaternion_wxyz: tuple[float, float, float, float]) -> float | None:
    if not all(map(math.isfinite, quaternion_wxyz)):
        return None
    w, x, y, z = quaternion_wxyz
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

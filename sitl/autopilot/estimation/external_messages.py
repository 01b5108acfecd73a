"""Stores the external messages that the autopilot receives, with their age.

DISTANCE_SENSOR, OBSTACLE_DISTANCE ─────────────────────────► ranges by orientation
ODOMETRY, VISION_POSITION_ESTIMATE, VISION_SPEED_ESTIMATE ──► a pose, if accepted
HEARTBEAT ──────────────────────────────────────────────────► ground station, companion
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import Vector3
from companion.core.values import value
from sitl.autopilot.streams import Message

RANGE_TIMEOUT_S = 0.5
"""Ranges older than this are dropped, s. Measured on ArduCopter 4.6.3."""
AROUND = (0, 1, 2, 3, 4, 5, 6, 7, 24)
"""MAV_SENSOR_ORIENTATION of proximity sensors: eight around in steps of 45°, and up."""
DOWN = 25
"""MAV_SENSOR_ORIENTATION of a downward sensor."""
NEVER = -math.inf
FARTHEST = 1e5
"""Components of a pose beyond this are rejected, m or m/s. Chosen: beyond any building."""


@value
class ExternalPoseMessages:
    """Pose messages that an autopilot accepts."""

    odometry_frames: tuple[int, ...]
    """Accepted MAV_FRAMEs of ODOMETRY (331)."""
    estimator_types: tuple[int, ...] | None = None
    """Accepted MAV_ESTIMATOR_TYPEs of ODOMETRY; None accepts all."""
    takes_vision_speed: bool = True
    """VISION_SPEED_ESTIMATE (103) is accepted."""


@value
class ExternalPose:
    """An external pose estimate: NED, m, m/s, yaw from north; None if not reported."""

    position_ned_m: Vector3 | None = None
    velocity_ned_m_s: Vector3 | None = None
    yaw_rad: float | None = None
    reset_counter: int = 0


class ExternalMessages:
    """The latest external messages. Time is an argument."""

    def __init__(self, accepted: ExternalPoseMessages) -> None:
        self._accepted = accepted
        self.ranges: dict[int, tuple[float, Message]] = {}
        """Time of arrival, s, and DISTANCE_SENSOR (132), by orientation."""
        self._obstacles_s = NEVER
        self._pose: ExternalPose | None = None
        self._pose_s = NEVER
        self._ground_station_s = self._onboard_computer_s = NEVER

    def receive(self, message: Message, now_s: float) -> str:
        """Store a message; ignore other types. Return the complaint to send, if any."""
        match message.get_type():
            case "DISTANCE_SENSOR":
                self.ranges[message.orientation] = now_s, message
            case "OBSTACLE_DISTANCE":
                self._obstacles_s = now_s
            case "VISION_POSITION_ESTIMATE":
                self._store_pose(_position_estimate(message), now_s)
            case "VISION_SPEED_ESTIMATE" if self._accepted.takes_vision_speed:
                self._store_pose(
                    ExternalPose(None, _finite((message.x, message.y, message.z))), now_s
                )
            case "ODOMETRY":
                return self._receive_odometry(message, now_s)
            case "HEARTBEAT":
                self._store_heartbeat(message, now_s)
        return ""

    def _receive_odometry(self, message: Message, now_s: float) -> str:
        types = self._accepted.estimator_types
        if types is not None and message.estimator_type not in types:
            return f"ODOMETRY: estimator_type {message.estimator_type} unsupported"
        if message.frame_id in self._accepted.odometry_frames:
            self._store_pose(_odometry(message), now_s)
        return ""

    def _store_heartbeat(self, message: Message, now_s: float) -> None:
        if message.type == mavlink.MAV_TYPE_GCS:
            self._ground_station_s = now_s
        elif message.type == mavlink.MAV_TYPE_ONBOARD_CONTROLLER:
            self._onboard_computer_s = now_s

    def _store_pose(self, pose: ExternalPose | None, now_s: float) -> None:
        """Store a pose. Position and velocity of one moment may come in two messages."""
        if pose is None or pose == ExternalPose(reset_counter=pose.reset_counter):
            return
        if self._pose is not None and pose.position_ned_m is None:
            pose = replace(self._pose, velocity_ned_m_s=pose.velocity_ned_m_s)
        elif self._pose is not None and pose.velocity_ned_m_s is None:
            pose = replace(pose, velocity_ned_m_s=self._pose.velocity_ned_m_s)
        self._pose, self._pose_s = pose, now_s

    def take_pose(self) -> ExternalPose | None:
        """The pose received since the last call, if any."""
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
        """Ranges not older than 0.5 s, by orientation."""
        return {message.orientation: message for _, message in self.fresh(now_s)}

    def fresh(self, now_s: float) -> list[tuple[float, Message]]:
        """Ranges not older than 0.5 s, each with its time of arrival."""
        return [
            received for received in self.ranges.values() if now_s - received[0] <= RANGE_TIMEOUT_S
        ]


def _finite(vector: tuple[float, float, float]) -> Vector3 | None:
    """The vector, or None if it is not finite or too large."""
    return vector if all(abs(value) <= FARTHEST for value in vector) else None  # false for NaN too


def _position_estimate(message: Message) -> ExternalPose:
    """Decode VISION_POSITION_ESTIMATE (102): NED."""
    return ExternalPose(
        _finite((message.x, message.y, message.z)),
        None,
        message.yaw if math.isfinite(message.yaw) else None,
        message.reset_counter,
    )


def _odometry(message: Message) -> ExternalPose | None:
    """Decode ODOMETRY (331): pose in a local frame, velocity in the body frame."""
    if message.child_frame_id != mavlink.MAV_FRAME_BODY_FRD or message.quality < 0:
        return None
    yaw_rad = _yaw(message.q)
    velocity = _finite((message.vx, message.vy, message.vz))
    if velocity is not None and yaw_rad is not None:
        velocity = rotated(message.q, velocity)
    return ExternalPose(
        _finite((message.x, message.y, message.z)), velocity, yaw_rad, message.reset_counter
    )


def rotated(quaternion_wxyz: Sequence[float], vector_frd: Vector3) -> Vector3:
    """Rotate from the body frame to the quaternion's reference frame."""
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

"""Our pose, told to the autopilot as ODOMETRY (331), so that its position hold stops drifting.

The autopilot has a frame of its own: north by its compass, origin where it began. Ours begins where
the drone took off, along its first heading. How the two lie to each other is noted at the first
report and kept; from then on the autopilot is told where it is in its own frame.

Two reports a tick, one of them halfway back to the last tick: PX4 wants 30 to 50 a second.
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import Vector3, frd_to_ned, wrap_rad
from companion.core.messages import Pose
from companion.core.values import value
from companion.link.transports.transport import Message

HEIGHT_SIGMA_M = 0.05
TILT_SIGMA_RAD = 0.05
UNKNOWN = math.nan
UPPER_TRIANGLE = tuple((row, column) for row in range(6) for column in range(row, 6))
"""The order of a covariance of x, y, z, roll, pitch, yaw in MAVLink."""


@value
class _Alignment:
    """Where our origin lies in the autopilot's frame, and how it is turned."""

    north_m: float
    east_m: float
    down_m: float
    yaw_rad: float


class PoseReport:
    """Makes the messages; time is an argument."""

    def __init__(self) -> None:
        self._alignment: _Alignment | None = None
        self._last: Pose | None = None

    def messages(
        self, now_s: float, pose: Pose, told: tuple[Vector3, float] | None
    ) -> list[Message]:
        """What is due; nothing before the autopilot has told its own position and yaw."""
        if self._alignment is None:
            if told is None:
                return []
            self._alignment = _aligned(pose, *told)
        last, self._last = self._last, pose
        messages = [_message(now_s, pose, self._alignment)]
        if last is not None and last.reset_counter == pose.reset_counter:
            between = _halfway(last, pose)
            messages.insert(0, _message(between.time_s, between, self._alignment))
        return messages


def _aligned(pose: Pose, position_ned_m: Vector3, autopilot_yaw_rad: float) -> _Alignment:
    yaw_rad = wrap_rad(autopilot_yaw_rad - pose.yaw_rad)
    north_m, east_m = frd_to_ned(pose.north_m, pose.east_m, yaw_rad)
    north, east, down = position_ned_m
    return _Alignment(north - north_m, east - east_m, down - pose.down_m, yaw_rad)


def _halfway(one: Pose, other: Pose) -> Pose:
    def middle(a: float, b: float) -> float:
        return 0.5 * (a + b)

    return Pose(
        middle(one.time_s, other.time_s),
        middle(one.north_m, other.north_m),
        middle(one.east_m, other.east_m),
        middle(one.down_m, other.down_m),
        one.yaw_rad + 0.5 * wrap_rad(other.yaw_rad - one.yaw_rad),
        other.position_sigma_m,
        other.yaw_sigma_rad,
        other.reset_counter,
    )


def _message(time_s: float, pose: Pose, at: _Alignment) -> Message:
    """ODOMETRY (331): LOCAL_FRD with child BODY_FRD is what ArduPilot and PX4 both take.

    So is VIO: PX4 takes vision and VIO for sources of a pose, and refuses, for example, LIDAR.
    """
    north_m, east_m = frd_to_ned(pose.north_m, pose.east_m, at.yaw_rad)
    half_rad = 0.5 * wrap_rad(pose.yaw_rad + at.yaw_rad)
    return mavlink.MAVLink_odometry_message(
        round(1e6 * time_s),
        mavlink.MAV_FRAME_LOCAL_FRD,
        mavlink.MAV_FRAME_BODY_FRD,
        at.north_m + north_m,
        at.east_m + east_m,
        at.down_m + pose.down_m,
        [math.cos(half_rad), 0.0, 0.0, math.sin(half_rad)],
        *(UNKNOWN,) * 6,
        _covariance(pose),
        [UNKNOWN] * 21,
        pose.reset_counter % 256,
        mavlink.MAV_ESTIMATOR_TYPE_VIO,
        0,
    )


def _covariance(pose: Pose) -> list[float]:
    """(21,): the upper triangle, of which only the diagonal is told."""
    sigmas = (
        *(pose.position_sigma_m,) * 2,
        HEIGHT_SIGMA_M,
        *(TILT_SIGMA_RAD,) * 2,
        pose.yaw_sigma_rad,
    )
    return [sigmas[row] ** 2 if row == column else 0.0 for row, column in UPPER_TRIANGLE]

"""Sends the companion's pose to the autopilot as ODOMETRY (331); its position hold stops drifting.

The autopilot's frame has compass north and the autopilot's own origin. The companion's frame has
its origin at the take-off point, and north along the first heading. The transform between the two
is fixed at the first report. All poses are then sent in the autopilot's frame.

Each tick sends two reports, of which one is interpolated halfway back to the previous tick: PX4
requires 30 to 50 per second.
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.frames import Vector3, frd_to_ned, wrap_rad
from companion.core.messages import Pose
from companion.core.values import value
from companion.link.transports.transport import Message

HEIGHT_SIGMA_M = 0.05
"""Reported standard deviation of the height, m. Chosen."""
TILT_SIGMA_RAD = 0.05
"""Reported standard deviation of roll and pitch, rad. Chosen."""
UNKNOWN = math.nan
"""Value of an unknown field in ODOMETRY (331)."""
UPPER_TRIANGLE = tuple((row, column) for row in range(6) for column in range(row, 6))
"""Row and column of each covariance element in ODOMETRY (331): x, y, z, roll, pitch, yaw."""


@value
class _Alignment:
    """Position of our origin and rotation of our frame in the autopilot's local NED frame."""

    north_m: float
    east_m: float
    down_m: float
    yaw_rad: float


class PoseReport:
    """Creates the ODOMETRY messages; time is an argument."""

    def __init__(self) -> None:
        self._alignment: _Alignment | None = None
        self._last: Pose | None = None

    def messages(
        self, now_s: float, pose: Pose, autopilot_pose: tuple[Vector3, float] | None
    ) -> list[Message]:
        """Messages for this tick; none before the autopilot reports its own position and yaw.

        `autopilot_pose`: the autopilot's position (local NED, m) and yaw (rad).
        """
        if self._alignment is None:
            if autopilot_pose is None:
                return []
            self._alignment = _aligned(pose, *autopilot_pose)
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
    """ODOMETRY (331) in LOCAL_FRD with child BODY_FRD, which ArduPilot and PX4 both accept.

    The estimator type is VIO: as a source of a pose, PX4 accepts vision and VIO, and rejects, for
    example, LIDAR.
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
    """Upper triangle of the pose covariance (21,), with only the diagonal set; m² and rad²."""
    sigmas = (
        *(pose.position_sigma_m,) * 2,
        HEIGHT_SIGMA_M,
        *(TILT_SIGMA_RAD,) * 2,
        pose.yaw_sigma_rad,
    )
    return [sigmas[row] ** 2 if row == column else 0.0 for row, column in UPPER_TRIANGLE]

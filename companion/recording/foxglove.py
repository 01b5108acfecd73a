"""Encodes the flight as Foxglove messages for its 3D, plot and log panels.

Frames follow the panels' conventions: "map" is ENU with its origin at take-off, "base_link" is FLU.
https://docs.foxglove.dev/docs/sdk/schemas describes the messages.
"""

import math
from collections.abc import Sequence

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from companion.core.frames import ned_to_enu, yaw_ned_to_enu
from companion.core.messages import Beam, Pose, RangeReading, RangeScan, RangeState, WallSegment

MAP_FRAME, BODY_FRAME = "map", "base_link"
"""Frame ids of local ENU and of the body."""
HORIZONTAL_BEAMS = (Beam.RIGHT, Beam.FRONT, Beam.LEFT, Beam.BACK)
"""Beams in the anticlockwise order of a LaserScan."""
FIRST_ANGLE_RAD, LAST_ANGLE_RAD = -math.pi / 2, math.pi
"""Angles of the first and the last beam, anticlockwise from the nose."""
WALL_THICKNESS_M = 0.03
"""Drawn thickness of a wall, m. Chosen."""
UNKNOWN_CEILING_M = 2.5
"""Drawn height of walls without a measured ceiling, m. Chosen."""
POSE_SIZE = 6
"""Rows of a pose covariance."""
_X, _Y, _YAW = (row * (POSE_SIZE + 1) for row in (0, 1, 5))
"""Indices of these variances in a 6 × 6 covariance, row by row."""


def to_ns(time_s: float) -> int:
    return round(time_s * 1e9)


def transform(pose: Pose) -> FrameTransform:
    message = FrameTransform(parent_frame_id=MAP_FRAME, child_frame_id=BODY_FRAME)
    _set_time(message.timestamp, pose.time_s)
    _set_place(message.translation, message.rotation, pose)
    return message


def pose_with_covariance(pose: Pose) -> Odometry:
    """The sigma of the position applies to both axes."""
    message = Odometry(frame_id=MAP_FRAME, body_frame_id=BODY_FRAME)
    _set_time(message.timestamp, pose.time_s)
    _set_place(message.pose.position, message.pose.orientation, pose)
    covariance = [0.0] * POSE_SIZE**2
    covariance[_X] = covariance[_Y] = pose.position_sigma_m**2
    covariance[_YAW] = pose.yaw_sigma_rad**2
    message.pose_covariance.extend(covariance)
    return message


def laser_scan(scan: RangeScan, mount_offset_m: float) -> LaserScan:
    """Horizontal beams from the drone's centre; NaN: no distance, infinity: free space."""
    message = LaserScan(
        frame_id=BODY_FRAME,
        start_angle=FIRST_ANGLE_RAD,
        end_angle=LAST_ANGLE_RAD,
        ranges=[_range_m(scan.readings.get(beam), mount_offset_m) for beam in HORIZONTAL_BEAMS],
    )
    _set_time(message.timestamp, scan.time_s)
    return message


def _set_time(timestamp: Timestamp, time_s: float) -> None:
    timestamp.seconds, timestamp.nanos = divmod(to_ns(time_s), 1_000_000_000)


def _set_place(position: Vector3, orientation: Quaternion, pose: Pose) -> None:
    position.x, position.y, position.z = ned_to_enu((pose.north_m, pose.east_m, pose.down_m))
    _turn_about_up(orientation, yaw_ned_to_enu(pose.yaw_rad))


def _turn_about_up(orientation: Quaternion, angle_rad: float) -> None:
    """Rotation about the up axis, anticlockwise seen from above."""
    orientation.z, orientation.w = math.sin(angle_rad / 2), math.cos(angle_rad / 2)


def _range_m(reading: RangeReading | None, mount_offset_m: float) -> float:
    if reading is None:
        return math.nan
    if reading.state is RangeState.NOTHING:
        return math.inf
    return mount_offset_m + reading.distance_m


def walls_scene(
    time_s: float, walls: Sequence[WallSegment], ceiling_m: float | None = None
) -> SceneUpdate:
    """Walls as thin boxes from floor to ceiling; each update replaces the last."""
    scene = SceneUpdate()
    entity = scene.entities.add(frame_id=MAP_FRAME, id="walls")
    _set_time(entity.timestamp, time_s)
    height_m = UNKNOWN_CEILING_M if ceiling_m is None else ceiling_m
    for wall in walls:
        (north_a, east_a), (north_b, east_b) = wall.start_ne_m, wall.end_ne_m
        cube = entity.cubes.add()
        cube.pose.position.x = (east_a + east_b) / 2
        cube.pose.position.y = (north_a + north_b) / 2
        cube.pose.position.z = height_m / 2
        angle_rad = math.atan2(north_b - north_a, east_b - east_a)
        _turn_about_up(cube.pose.orientation, angle_rad)
        cube.size.x, cube.size.y, cube.size.z = wall.length_m, WALL_THICKNESS_M, height_m
        cube.color.r, cube.color.g, cube.color.b, cube.color.a = 0.35, 0.45, 0.55, 0.8
    return scene


def log(time_s: float, level: Log.Level.ValueType, name: str, text: str) -> Log:
    message = Log(level=level, name=name, message=text)
    _set_time(message.timestamp, time_s)
    return message

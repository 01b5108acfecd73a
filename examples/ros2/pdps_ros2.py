"""Converts the topics of a recording, or of the live stream, into ROS 2 messages.

| ROS 2 topic | type | from |
|---|---|---|
| /map | nav_msgs/OccupancyGrid | /walls, and the beams of /scan |
| /scan | sensor_msgs/LaserScan | /scan |
| /odom | nav_msgs/Odometry | /pose |
| /tf | tf2_msgs/TFMessage, odom to base_link | /tf |
| /tf_static | tf2_msgs/TFMessage, map to odom | fixed: the same frame |

The message types are those of rclpy or of rosbags, whichever the caller has.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

MAP_FRAME, ODOM_FRAME, BODY_FRAME = "map", "odom", "base_link"
"""Frames of REP 105."""
NEEDED = ("/walls", "/scan", "/pose", "/tf")
"""Topics of the companion that are converted."""
TYPES = {
    "/map": "nav_msgs/msg/OccupancyGrid",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/tf_static": "tf2_msgs/msg/TFMessage",
}
"""Topics and types for ROS 2."""
LATCHED = ("/map", "/tf_static")
"""Topics whose last message a late subscriber receives, too: durability transient local."""
CELL_M = 0.05
"""Size of a cell, m: that of the companion's other maps."""
OCCUPIED, FREE, UNKNOWN = 100, 0, -1
"""Values of a cell."""
MIN_RANGE_M, MAX_RANGE_M = 0.02, 12.0
"""Bounds of a range, m: those of all sensors together."""
UNSURE_M = 0.3
"""End of a beam that frees no cell, m: the error of a range near the bound of a Sharp sensor."""
UNKNOWN_TWIST = -1.0
"""First element of the covariance of a twist that is not known."""

Cell = tuple[int, int]
"""Column and row of a cell, east and north of the take-off point."""


class Converted(NamedTuple):
    """A message for ROS 2."""

    topic: str
    time_ns: int
    message: Any


@dataclass(frozen=True)
class Messages:
    """Makes messages of the caller's ROS 2 library."""

    type_of: Callable[[str], Any]
    """The class of a type's name."""
    sequence: Callable[[np.ndarray], Any]
    """Value of a field with many numbers: an array for rosbags, a list for rclpy."""

    def make(self, name: str, **fields: Any) -> Any:
        return self.type_of(name)(**fields)

    def header(self, time_ns: int, frame: str) -> Any:
        return self.make("std_msgs/msg/Header", stamp=self.time(time_ns), frame_id=frame)

    def time(self, time_ns: int) -> Any:
        seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
        return self.make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)

    def vector(self, kind: str, x: float, y: float, z: float) -> Any:
        return self.make(f"geometry_msgs/msg/{kind}", x=x, y=y, z=z)

    def quaternion(self, of: Any) -> Any:
        return self.make("geometry_msgs/msg/Quaternion", x=of.x, y=of.y, z=of.z, w=of.w)


class Converter:
    """Converts messages in the order of their times."""

    def __init__(self, messages: Messages, start_ns: int) -> None:
        """`start_ns`: the time at which the flight's own clock was 0, ns since 1970."""
        self._messages = messages
        self._start_ns = start_ns
        self._pose: Odometry | None = None
        self._free: set[Cell] = set()
        self._is_begun = False

    def convert(self, topic: str, time_ns: int, data: bytes) -> Iterator[Converted]:
        """Messages for ROS 2 from one of the companion's."""
        time_ns += self._start_ns
        if not self._is_begun:
            self._is_begun = True
            yield Converted("/tf_static", time_ns, self._map_to_odom(time_ns))
        match topic:
            case "/pose":
                self._pose = Odometry.FromString(data)
                yield Converted("/odom", time_ns, self._odometry(time_ns, self._pose))
            case "/tf":
                transform = FrameTransform.FromString(data)
                yield Converted("/tf", time_ns, self._odom_to_body(time_ns, transform))
            case "/scan":
                scan = LaserScan.FromString(data)
                self._see_through(scan)
                yield Converted("/scan", time_ns, self._scan(time_ns, scan))
            case "/walls":
                scene = SceneUpdate.FromString(data)
                yield Converted("/map", time_ns, self._grid(time_ns, scene))

    def _map_to_odom(self, time_ns: int) -> Any:
        still = FrameTransform()
        still.rotation.w = 1.0
        return self._transform(time_ns, MAP_FRAME, ODOM_FRAME, still)

    def _odom_to_body(self, time_ns: int, transform: FrameTransform) -> Any:
        return self._transform(time_ns, ODOM_FRAME, BODY_FRAME, transform)

    def _transform(self, time_ns: int, parent: str, child: str, of: FrameTransform) -> Any:
        ros, at = self._messages, of.translation
        transform = ros.make(
            "geometry_msgs/msg/Transform",
            translation=ros.vector("Vector3", at.x, at.y, at.z),
            rotation=ros.quaternion(of.rotation),
        )
        stamped = ros.make(
            "geometry_msgs/msg/TransformStamped",
            header=ros.header(time_ns, parent),
            child_frame_id=child,
            transform=transform,
        )
        return ros.make("tf2_msgs/msg/TFMessage", transforms=[stamped])

    def _odometry(self, time_ns: int, pose: Odometry) -> Any:
        """The pose; its velocity is not known."""
        ros, at = self._messages, pose.pose.position
        still = ros.vector("Vector3", 0.0, 0.0, 0.0)
        unknown = np.zeros(36)
        unknown[0] = UNKNOWN_TWIST
        return ros.make(
            "nav_msgs/msg/Odometry",
            header=ros.header(time_ns, ODOM_FRAME),
            child_frame_id=BODY_FRAME,
            pose=ros.make(
                "geometry_msgs/msg/PoseWithCovariance",
                pose=self._pose_at(at.x, at.y, at.z, pose.pose.orientation),
                covariance=np.array(pose.pose_covariance),
            ),
            twist=ros.make(
                "geometry_msgs/msg/TwistWithCovariance",
                twist=ros.make("geometry_msgs/msg/Twist", linear=still, angular=still),
                covariance=unknown,
            ),
        )

    def _pose_at(self, x: float, y: float, z: float, orientation: Any) -> Any:
        ros = self._messages
        return ros.make(
            "geometry_msgs/msg/Pose",
            position=ros.vector("Point", x, y, z),
            orientation=ros.quaternion(orientation),
        )

    def _scan(self, time_ns: int, scan: LaserScan) -> Any:
        """Four beams; by REP 117 infinity is free space, and NaN no measurement."""
        count = len(scan.ranges)
        return self._messages.make(
            "sensor_msgs/msg/LaserScan",
            header=self._messages.header(time_ns, BODY_FRAME),
            angle_min=scan.start_angle,
            angle_max=scan.end_angle,
            angle_increment=(scan.end_angle - scan.start_angle) / (count - 1),
            time_increment=0.0,
            scan_time=0.0,
            range_min=MIN_RANGE_M,
            range_max=MAX_RANGE_M,
            ranges=self._messages.sequence(np.array(scan.ranges, np.float32)),
            intensities=self._messages.sequence(np.zeros(0, np.float32)),
        )

    def _see_through(self, scan: LaserScan) -> None:
        """Note the cells that beams with an obstacle at their end have passed."""
        if self._pose is None:
            return
        at, turn = self._pose.pose.position, self._pose.pose.orientation
        yaw_rad = 2 * math.atan2(turn.z, turn.w)
        angles = np.linspace(scan.start_angle, scan.end_angle, len(scan.ranges))
        for angle_rad, range_m in zip(yaw_rad + angles, scan.ranges, strict=True):
            if math.isfinite(range_m):
                along_m = np.arange(0.0, range_m - UNSURE_M, CELL_M)
                self._free |= _cells(
                    at.x + along_m * math.cos(angle_rad), at.y + along_m * math.sin(angle_rad)
                )

    def _grid(self, time_ns: int, scene: SceneUpdate) -> Any:
        """Walls occupied, cells that were seen through free, all others unknown."""
        walls = {cell for entity in scene.entities for cube in entity.cubes for cell in _wall(cube)}
        known = walls | self._free or {(0, 0)}
        first = np.min(list(known), axis=0)
        columns, rows = np.max(list(known), axis=0) - first + 1
        values = np.full((rows, columns), UNKNOWN, np.int8)
        for cells, value in ((self._free, FREE), (walls, OCCUPIED)):
            for column, row in cells:
                values[row - first[1], column - first[0]] = value
        ros = self._messages
        level = ros.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
        info = ros.make(
            "nav_msgs/msg/MapMetaData",
            map_load_time=ros.time(time_ns),
            resolution=CELL_M,
            width=int(columns),
            height=int(rows),
            origin=self._pose_at(float(first[0] * CELL_M), float(first[1] * CELL_M), 0.0, level),
        )
        return ros.make(
            "nav_msgs/msg/OccupancyGrid",
            header=ros.header(time_ns, MAP_FRAME),
            info=info,
            data=ros.sequence(values.ravel()),
        )


def _wall(cube: Any) -> set[Cell]:
    """Cells along the middle line of a wall."""
    at, turn = cube.pose.position, cube.pose.orientation
    yaw_rad, half_m = 2 * math.atan2(turn.z, turn.w), cube.size.x / 2
    along_m = np.linspace(-half_m, half_m, math.ceil(cube.size.x / CELL_M * 2) + 1)
    return _cells(at.x + along_m * math.cos(yaw_rad), at.y + along_m * math.sin(yaw_rad))


def _cells(x_m: np.ndarray, y_m: np.ndarray) -> set[Cell]:
    columns, rows = (np.floor(each / CELL_M).astype(int).tolist() for each in (x_m, y_m))
    return set(zip(columns, rows, strict=True))

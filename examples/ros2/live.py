"""Publishes a flight live in ROS 2, from the stream of `companion fly --foxglove`.

    source /opt/ros/jazzy/setup.bash
    pip install pdps-companion websockets
    python3 examples/ros2/live.py ws://127.0.0.1:8765

A node of rclpy, for any middleware of ROS 2.
"""

import argparse
from importlib import import_module
from typing import Any

import rclpy
from pdps_ros2 import LATCHED, TYPES, Messages
from rclpy.qos import DurabilityPolicy, QoSProfile
from stream import URL, received


def type_of(name: str) -> Any:
    """The class of a ROS 2 type: nav_msgs/msg/Odometry is nav_msgs.msg.Odometry."""
    package, _, kind = name.split("/")
    return getattr(import_module(f"{package}.msg"), kind)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("url", nargs="?", default=URL)
    options, _ = parser.parse_known_args()  # ROS 2 adds arguments of its own
    rclpy.init()
    node = rclpy.create_node("pdps")
    kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publishers = {
        topic: node.create_publisher(type_of(name), topic, kept if topic in LATCHED else 10)
        for topic, name in TYPES.items()
    }
    try:
        for each in received(options.url, Messages(type_of, lambda values: values.tolist())):
            publishers[each.topic].publish(each.message)
    finally:
        node.destroy_node()
        rclpy.shutdown()


if __name__ == "__main__":
    main()

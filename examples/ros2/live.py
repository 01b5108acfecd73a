"""Publishes a flight live in ROS 2, from the stream of `companion fly --foxglove`.

    source /opt/ros/jazzy/setup.bash
    pip install pdps-companion websockets
    python3 examples/ros2/live.py ws://127.0.0.1:8765

A node of rclpy, for any middleware of ROS 2.
"""

import argparse
import json
import struct
import time
from collections.abc import Iterator
from importlib import import_module
from typing import Any

from pdps_ros2 import LATCHED, NEEDED, TYPES, Converted, Converter, Messages
from websockets import ConnectionClosed, Subprotocol
from websockets.sync.client import ClientConnection, connect

SUBPROTOCOL = Subprotocol("foxglove.sdk.v1")
MESSAGE_DATA = 1
"""Opcode of a binary message with data."""
HEADER = struct.Struct("<BIQ")
"""Opcode, subscription, and time, ns, before the data."""


def received(url: str, messages: Messages) -> Iterator[Converted]:
    """The stream's messages for ROS 2, until the flight ends."""
    with connect(url, subprotocols=[SUBPROTOCOL]) as connection:
        topics = _subscribe(connection)
        converter = None
        try:
            for frame in connection:
                if isinstance(frame, str) or frame[0] != MESSAGE_DATA:
                    continue
                _, subscription, time_ns = HEADER.unpack_from(frame)
                if converter is None:
                    converter = Converter(messages, time.time_ns() - time_ns)
                yield from converter.convert(topics[subscription], time_ns, frame[HEADER.size :])
        except ConnectionClosed:
            return


def _subscribe(connection: ClientConnection) -> dict[int, str]:
    """Subscribe to the topics that are needed; returns them by their subscription."""
    topics: dict[int, str] = {}
    while len(topics) < len(NEEDED):
        frame = connection.recv()
        news = json.loads(frame) if isinstance(frame, str) else {}  # the clock may come first
        topics |= {c["id"]: c["topic"] for c in news.get("channels", ()) if c["topic"] in NEEDED}
    wanted = [{"id": channel, "channelId": channel} for channel in topics]
    connection.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
    return topics


def _type_of(name: str) -> Any:
    """The class of a ROS 2 type: nav_msgs/msg/Odometry is nav_msgs.msg.Odometry."""
    package, _, kind = name.split("/")
    return getattr(import_module(f"{package}.msg"), kind)


def main() -> None:
    import rclpy  # noqa: PLC0415 - only on a machine with ROS 2
    from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: PLC0415

    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("url", nargs="?", default="ws://127.0.0.1:8765")
    options, _ = parser.parse_known_args()  # ROS 2 adds arguments of its own
    rclpy.init()
    node = rclpy.create_node("pdps")
    kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publishers = {
        topic: node.create_publisher(_type_of(name), topic, kept if topic in LATCHED else 10)
        for topic, name in TYPES.items()
    }
    try:
        for each in received(options.url, Messages(_type_of, lambda values: values.tolist())):
            publishers[each.topic].publish(each.message)
    finally:
        node.destroy_node()
        rclpy.shutdown()


if __name__ == "__main__":
    main()

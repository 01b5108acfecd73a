"""Writes a recording as a ROS 2 bag, without a ROS installation.

    pip install pdps-companion rosbags
    python examples/ros2/to_bag.py out/flight_....mcap bag
    ros2 bag play bag --clock        # on a machine with ROS 2

The bag is an MCAP file with CDR messages and its metadata, as `ros2 bag record` writes it.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

from mcap.reader import make_reader
from pdps_ros2 import LATCHED, NEEDED, TYPES, Converted, Converter, Messages
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

BAG_VERSION = 9
"""Version of metadata.yaml, read from ROS 2 Jazzy on."""
_EVER = QosTime(2147483647, 4294967295)
"""A duration without a limit."""
LATCHED_QOS = Qos(
    QosHistory.KEEP_LAST,
    1,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    _EVER,
    _EVER,
    QosLiveliness.AUTOMATIC,
    _EVER,
    avoid_ros_namespace_conventions=False,
)
"""Quality of service of topics whose last message is kept."""


def converted(recording: Path, messages: Messages) -> Iterator[Converted]:
    """The recording's messages for ROS 2, in order."""
    with recording.open("rb") as file:
        reader = make_reader(file)
        about = {entry.name: entry.metadata for entry in reader.iter_metadata()}
        began_s = float(about["recording"]["began_unix_s"])
        converter = Converter(messages, round(began_s * 1e9))
        for _, channel, message in reader.iter_messages(topics=NEEDED):
            yield from converter.convert(channel.topic, message.log_time, message.data)


def write_bag(recording: Path, bag: Path) -> int:
    """Write the bag, a new folder; returns the number of messages."""
    store = get_typestore(Stores.ROS2_JAZZY)
    count = 0
    with Writer(bag, version=BAG_VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {
            topic: writer.add_connection(
                topic,
                name,
                typestore=store,
                offered_qos_profiles=[LATCHED_QOS] if topic in LATCHED else [],
            )
            for topic, name in TYPES.items()
        }
        for topic, time_ns, message in converted(recording, Messages(store.types.get, _same)):
            data = store.serialize_cdr(message, TYPES[topic])
            writer.write(connections[topic], time_ns, data)
            count += 1
    return count


def _same(values: object) -> object:
    """Fields with many numbers are arrays."""
    return values


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("recording", type=Path, help="flight_....mcap")
    parser.add_argument("bag", type=Path, help="new folder")
    options = parser.parse_args()
    print(f"{options.bag}: {write_bag(options.recording, options.bag)} messages")


if __name__ == "__main__":
    main()

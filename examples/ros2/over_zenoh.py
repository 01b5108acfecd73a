"""Publishes a flight live in ROS 2 over Zenoh, from a machine without ROS.

    pip install 'pdps-companion[team]' rosbags websockets
    python examples/ros2/over_zenoh.py ws://127.0.0.1:8765 --router tcp/laptop:7447

On the laptop, with RMW_IMPLEMENTATION=rmw_zenoh_cpp in every terminal:

    ros2 run rmw_zenoh_cpp rmw_zenohd
    ros2 topic list

Key expressions, attachments and liveliness tokens are those of rmw_zenoh:
https://github.com/ros2/rmw_zenoh/blob/rolling/docs/design.md
"""

import argparse
import json
import secrets
import struct
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

import zenoh
from pdps_ros2 import TYPES, Converted, Messages
from rosbags.typesys import Stores, get_typestore
from stream import URL, received

STORE = get_typestore(Stores.ROS2_JAZZY)
ROUTER = "tcp/127.0.0.1:7447"
"""Usual address of rmw_zenohd."""
NODE = "pdps"
NAMESPACE = ENCLAVE = "%"
"""The empty namespace and enclave."""
QOS = "::,10:,:,:,,"
"""The usual quality of service, with a history of 10 messages."""
GID_BYTES = 16
"""Length of a publisher's identity."""
ATTACHMENT = struct.Struct(f"<qqB{GID_BYTES}s")
"""Number of the message, its time in ns since 1970, and the publisher's identity."""


def dds_name(name: str) -> str:
    """A ROS 2 type as DDS declares it: nav_msgs::msg::dds_::Odometry_."""
    package, kind, message = name.split("/")
    return f"{package}::{kind}::dds_::{message}_"


def key_of(topic: str, name: str, domain: int) -> str:
    """The key expression of a topic."""
    return f"{domain}/{topic.removeprefix('/')}/{dds_name(name)}/{STORE.hash_rihs01(name)}"


def tokens(session: str, domain: int, types: Mapping[str, str]) -> Iterator[str]:
    """Liveliness tokens, by which `ros2 node list` and `ros2 topic list` know node and topics."""
    here = f"@ros2_lv/{domain}/{session}/0"
    yield f"{here}/0/NN/{ENCLAVE}/{NAMESPACE}/{NODE}"
    for number, (topic, name) in enumerate(types.items(), 1):
        what = f"{topic.replace('/', '%')}/{dds_name(name)}/{STORE.hash_rihs01(name)}/{QOS}"
        yield f"{here}/{number}/MP/{ENCLAVE}/{NAMESPACE}/{NODE}/{what}"


class Publisher:
    """Publishes one topic."""

    def __init__(self, session: zenoh.Session, topic: str, name: str, domain: int) -> None:
        self._publisher = session.declare_publisher(key_of(topic, name, domain))
        self._name = name
        self._gid = secrets.token_bytes(GID_BYTES)
        self._number = 0

    def publish(self, message: Any) -> None:
        self._number += 1
        about = ATTACHMENT.pack(self._number, time.time_ns(), GID_BYTES, self._gid)
        data = bytes(STORE.serialize_cdr(message, self._name))
        self._publisher.put(data, attachment=about)


@contextmanager
def publishers(router: str, domain: int) -> Iterator[dict[str, Publisher]]:
    """The publishers of all topics, through a router."""
    config = zenoh.Config()
    config.insert_json5("mode", json.dumps("client"))
    config.insert_json5("connect/endpoints", json.dumps([router]))
    with ExitStack() as stack:
        session = stack.enter_context(zenoh.open(config))
        for token in tokens(str(session.zid()), domain, TYPES):
            stack.enter_context(session.liveliness().declare_token(token))
        yield {t: Publisher(session, t, name, domain) for t, name in TYPES.items()}


def publish(url: str, router: str, domain: int) -> None:
    """Publish until the flight ends; what is latched is repeated with each map."""
    fixed: Converted | None = None
    with publishers(router, domain) as by_topic:
        for each in received(url, Messages(STORE.types.get, lambda values: values)):
            if each.topic == "/tf_static":
                fixed = each
            elif each.topic == "/map" and fixed is not None:
                by_topic[fixed.topic].publish(fixed.message)
            by_topic[each.topic].publish(each.message)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("url", nargs="?", default=URL)
    parser.add_argument("--router", default=ROUTER, help="Zenoh address of rmw_zenohd")
    parser.add_argument("--domain", type=int, default=0, help="ROS_DOMAIN_ID")
    options = parser.parse_args()
    publish(options.url, options.router, options.domain)


if __name__ == "__main__":
    main()

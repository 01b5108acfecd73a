"""Receives the stream of `companion fly --foxglove`, and converts it into ROS 2 messages."""

import json
import struct
import time
from collections.abc import Iterator

from pdps_ros2 import NEEDED, Converted, Converter, Messages
from websockets import ConnectionClosed, Subprotocol
from websockets.sync.client import ClientConnection, connect

URL = "ws://127.0.0.1:8765"
"""Usual address of the stream."""
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

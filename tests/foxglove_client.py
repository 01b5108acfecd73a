"""A client of Foxglove's WebSocket protocol, as the Foxglove app speaks it.

https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md describes the protocol.
"""

import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from websockets import ConnectionClosed, Subprotocol
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from tests.waiting import DEADLINE_S

SUBPROTOCOL = Subprotocol("foxglove.sdk.v1")
MESSAGE_DATA, TIME = 1, 2
"""Opcodes of binary messages."""
_HEADER = struct.Struct("<BIQ")
"""Opcode, subscription and time, ns, of a message."""
_TIME = struct.Struct("<BQ")


@dataclass(frozen=True)
class Received:
    """One message of a topic."""

    topic: str
    time_s: float
    data: bytes


@dataclass
class FoxgloveClient:
    """Receives the advertised topics."""

    connection: Connection
    channels: dict[str, dict[str, str]] = field(default_factory=dict)
    """What the server says of each topic."""
    time_s: float = float("nan")
    """The server's clock."""

    def await_channels(self, count: int) -> None:
        """Wait until the server has advertised this many topics."""
        while len(self.channels) < count:
            frame = self.connection.recv(DEADLINE_S)
            news = json.loads(frame) if isinstance(frame, str) else {}  # the clock may come first
            self.channels |= {each["topic"]: each for each in news.get("channels", ())}

    def subscribe(self, *topics: str) -> None:
        wanted = [
            {"id": self.channels[t]["id"], "channelId": self.channels[t]["id"]} for t in topics
        ]
        self.connection.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    def messages(self) -> Iterator[Received]:
        """Messages until the server ends the connection."""
        names = {each["id"]: topic for topic, each in self.channels.items()}
        while True:
            try:
                frame = self.connection.recv(DEADLINE_S)
            except ConnectionClosed:
                return
            assert isinstance(frame, bytes), frame
            if frame[0] == TIME:
                self.time_s = _TIME.unpack(frame)[1] / 1e9
            elif frame[0] == MESSAGE_DATA:
                _, subscription, time_ns = _HEADER.unpack_from(frame)
                yield Received(names[subscription], time_ns / 1e9, frame[_HEADER.size :])

    def await_time(self, time_s: float) -> None:
        """Read until the server's clock has come to a time."""
        messages = self.messages()
        while not self.time_s >= time_s:
            next(messages)

    def next_of(self, topic: str) -> Received:
        """The next message of a topic."""
        return next(message for message in self.messages() if message.topic == topic)


@contextmanager
def foxglove_client(
    url: str, channels: int, most_unread: int | None = None
) -> Iterator[FoxgloveClient]:
    """Connect to a server that has so many topics.

    The client reads in the background, but at most `most_unread` messages that the test has not
    asked for.
    """
    with connect(
        url,
        subprotocols=[SUBPROTOCOL],
        open_timeout=DEADLINE_S,
        close_timeout=0.1,
        max_queue=most_unread,
    ) as connection:
        assert connection.subprotocol == SUBPROTOCOL
        client = FoxgloveClient(connection)
        client.await_channels(channels)
        yield client

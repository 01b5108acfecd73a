"""MAVLink as ground stations log it: before each packet its time, 64 bits, in µs since 1970.

Mission Planner, MAVExplorer and mavlogdump open it.
"""

import struct
from typing import Any

from companion.link.transports.transport import Message, Transport, make_codec

_TIME = struct.Struct(">Q")


class Tap:
    """A transport that remembers what went through it, both ways."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._passed: list[Message] = []
        self._remembers = True

    def receive(self) -> list[Message]:
        messages = self._transport.receive()
        if self._remembers:
            self._passed += messages
        return messages

    def send(self, message: Message) -> None:
        self._transport.send(message)
        if self._remembers:
            self._passed.append(message)

    def forget(self) -> None:
        """Nobody will take it: the recording has stopped."""
        self._remembers = False
        self._passed = []

    def close(self) -> None:
        self._transport.close()

    def take(self) -> list[Message]:
        """What has passed since the last call, in order."""
        passed, self._passed = self._passed, []
        return passed


class TlogEncoder:
    """Messages to a tlog's bytes."""

    def __init__(self, began_unix_s: float) -> None:
        self._began_unix_s = began_unix_s
        self._codecs: dict[tuple[int, int], Any] = {}

    def encode(self, time_s: float, messages: list[Message]) -> bytes:
        time = _TIME.pack(round(1e6 * (self._began_unix_s + time_s)))
        return b"".join(time + self._packet(message) for message in messages)

    def _packet(self, message: Message) -> bytes:
        """As it was on the wire; a message that was handed over as an object never was there."""
        packet = message.get_msgbuf()
        if not packet:
            sender = message.get_srcSystem(), message.get_srcComponent()
            codec = self._codecs.get(sender) or self._codecs.setdefault(sender, make_codec(*sender))
            packet = message.pack(codec)
            codec.seq = (codec.seq + 1) % 256
        return bytes(packet)

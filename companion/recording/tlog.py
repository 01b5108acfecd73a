"""MAVLink log format of ground stations: each packet follows its time, 64 bits, in µs since 1970.

Mission Planner, MAVExplorer and mavlogdump open it.
"""

import struct
from typing import Any

from companion.link.transports.transport import Message, Transport, make_codec

_TIME = struct.Struct(">Q")


class Tap:
    """A transport that records its messages, both ways."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._recorded: list[Message] = []
        self._is_recording = True

    def receive(self) -> list[Message]:
        messages = self._transport.receive()
        if self._is_recording:
            self._recorded += messages
        return messages

    def send(self, message: Message) -> None:
        self._transport.send(message)
        if self._is_recording:
            self._recorded.append(message)

    def stop(self) -> None:
        """Stop recording; the messages are no longer needed."""
        self._is_recording = False
        self._recorded = []

    def close(self) -> None:
        self._transport.close()

    def take(self) -> list[Message]:
        """Messages since the last call, in order."""
        recorded, self._recorded = self._recorded, []
        return recorded


class TlogEncoder:
    """Encodes messages as bytes of a tlog."""

    def __init__(self, began_unix_s: float) -> None:
        self._began_unix_s = began_unix_s
        self._codecs: dict[tuple[int, int], Any] = {}

    def encode(self, time_s: float, messages: list[Message]) -> bytes:
        time = _TIME.pack(round(1e6 * (self._began_unix_s + time_s)))
        return b"".join(time + self._packet(message) for message in messages)

    def _packet(self, message: Message) -> bytes:
        """Bytes as on the wire; a message that was passed as an object is encoded here."""
        packet = message.get_msgbuf()
        if not packet:
            sender = message.get_srcSystem(), message.get_srcComponent()
            codec = self._codecs.get(sender) or self._codecs.setdefault(sender, make_codec(*sender))
            packet = message.pack(codec)
            codec.seq = (codec.seq + 1) % 256
        return bytes(packet)

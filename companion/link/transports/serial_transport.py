"""Transports MAVLink over a serial port, such as "serial:/dev/ttyAMA0:921600"."""

import time

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.errors import LinkError
from companion.link.signing import Signing
from companion.link.transports.serial_line import Port, SerialLine
from companion.link.transports.transport import Message, decode_stream, frame, make_codec

RETRY_PERIOD_S = 1.0
"""Period of the attempts to reopen a disconnected port, s. Chosen."""
URGENT = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
        mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
    }
)
"""Messages required for flight; poses, ranges and texts use the remaining capacity."""


class SerialTransport:
    """Serial port that is reopened after its adapter was unplugged and plugged in again.

    Raises:
        LinkError: the port cannot be opened.
    """

    def __init__(
        self, url: str, system_id: int, component_id: int, signing: Signing | None = None
    ) -> None:
        self._path, _, baud = url.removeprefix("serial:").rpartition(":")
        self._baud = int(baud)
        self._codec = make_codec(system_id, component_id, signing)
        self._retry_at_s = 0.0
        self.bytes_received = self.messages_received = 0
        """Many bytes without a message indicate a wrong baud rate."""
        self.messages_sent = self.messages_dropped = 0
        """Dropped messages were not accepted by the port, or would have been sent too late."""
        self._port: Port | None = None
        try:
            self._connect()
        except OSError as error:
            raise LinkError(
                f"{url}: {error.strerror or error}; check the port's name, enable its UART "
                "(raspi-config, without a login shell) and add this user to the group dialout"
            ) from error

    def _connect(self) -> Port:
        port = self._open()
        self._port, self._line = port, SerialLine(port, self._baud)
        return port

    def _open(self) -> Port:
        from companion.link.transports.uart import Uart  # noqa: PLC0415 - only serial links need it

        return Uart(self._path, self._baud)

    def receive(self) -> list[Message]:
        try:
            port = self._ready_port()
            data = port.read(port.in_waiting)
        except OSError:
            self._drop()
            return []
        self.bytes_received += len(data)
        messages = decode_stream(self._codec, data)
        self.messages_received += len(messages)
        return messages

    def send(self, message: Message) -> None:
        number = self._codec.seq
        data = frame(self._codec, message)
        is_urgent = message.get_msgId() in URGENT
        try:
            self._ready_port()
            is_sent = self._line.send(data, time.monotonic(), is_urgent=is_urgent)
        except OSError:
            is_sent = False
            self._drop()
        if not is_sent:
            self._codec.seq = number
            self.messages_dropped += 1
            return
        self.messages_sent += 1

    def _ready_port(self) -> Port:
        if self._port is None:
            if time.monotonic() < self._retry_at_s:
                raise OSError(f"{self._path} is gone")
            self._retry_at_s = time.monotonic() + RETRY_PERIOD_S
            return self._connect()
        return self._port

    def _drop(self) -> None:
        self.close()
        self._port = None

    def close(self) -> None:
        if self._port is not None:
            self._port.close()

"""MAVLink over a serial port, such as "serial:/dev/ttyAMA0:921600" on a Raspberry Pi."""

import time
from typing import Any

from companion.errors import LinkError
from companion.link.signing import Signing
from companion.link.transport import Message, decode_stream, frame, make_codec

RETRY_PERIOD_S = 1.0


class SerialTransport:
    """Bytes at a port; an adapter that was pulled out and put in again is opened again.

    Raises:
        LinkError: the port cannot be opened.
    """

    def __init__(
        self, url: str, system_id: int, component_id: int, signing: Signing | None = None
    ) -> None:
        _, self._path, baud = url.split(":")
        self._baud = int(baud)
        self._codec = make_codec(system_id, component_id, signing)
        self._retry_at_s = 0.0
        self.bytes_received = self.messages_received = 0
        """Many bytes and no message: the baud rate is wrong."""
        try:
            self._port: Any = self._open()
        except OSError as error:
            raise LinkError(
                f"{url}: {error.strerror or error}; check the port's name, enable its UART "
                "(raspi-config, without a login shell) and add this user to the group dialout"
            ) from error

    def _open(self) -> Any:
        import serial  # noqa: PLC0415 - few need it

        return serial.Serial(self._path, self._baud, timeout=0, write_timeout=0, exclusive=True)

    def receive(self) -> list[Message]:
        try:
            data = self._ready_port().read(self._port.in_waiting)
        except OSError:
            self._drop()
            return []
        self.bytes_received += len(data)
        messages = decode_stream(self._codec, data)
        self.messages_received += len(messages)
        return messages

    def send(self, message: Message) -> None:
        data = frame(self._codec, message)
        try:
            self._ready_port().write(data)
        except OSError:
            self._drop()

    def _ready_port(self) -> Any:
        if self._port is None:
            if time.monotonic() < self._retry_at_s:
                raise OSError(f"{self._path} is gone")
            self._retry_at_s = time.monotonic() + RETRY_PERIOD_S
            self._port = self._open()
        return self._port

    def _drop(self) -> None:
        self.close()
        self._port = None

    def close(self) -> None:
        if self._port is not None:
            self._port.close()

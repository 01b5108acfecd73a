"""Opens a serial port whose writes never block; those of pyserial block or busy-wait."""

import contextlib
import os
import termios

import serial


class Uart(serial.Serial):
    """Serial port with non-blocking and exclusive access.

    Raises:
        OSError: the port cannot be opened, or is disconnected.
    """

    def __init__(self, path: str, baud: int) -> None:
        try:
            super().__init__(path, baud, timeout=0, exclusive=True)
        except termios.error as error:  # unplugged between open and configuration
            raise OSError(*error.args) from error

    def write(self, data: bytes) -> int:  # type: ignore[override]
        """Write without blocking; returns the number of accepted bytes."""
        assert self.fd is not None
        try:
            return os.write(self.fd, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Discard unsent bytes and close: otherwise the kernel waits half a minute to send them."""
        if self.is_open:
            with contextlib.suppress(OSError, termios.error):
                self.reset_output_buffer()
        super().close()

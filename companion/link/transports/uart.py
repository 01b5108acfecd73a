"""A serial port that takes what fits and never waits; pyserial's own waits, or spins."""

import contextlib
import os
import termios

import serial


class Uart(serial.Serial):
    """Opened without blocking, for us alone.

    Raises:
        OSError: it cannot be opened, or is gone.
    """

    def __init__(self, path: str, baud: int) -> None:
        try:
            super().__init__(path, baud, timeout=0, exclusive=True)
        except termios.error as error:  # unplugged between opening it and setting it up
            raise OSError(*error.args) from error

    def write(self, data: bytes) -> int:  # type: ignore[override]
        """How many of the bytes were taken."""
        assert self.fd is not None
        try:
            return os.write(self.fd, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """What has not left is forgotten: the kernel would wait half a minute for it to leave."""
        if self.is_open:
            with contextlib.suppress(OSError, termios.error):
                self.reset_output_buffer()
        super().close()

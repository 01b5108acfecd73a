"""Sends whole messages over a serial port, with a bounded backlog.

A UART sends a tenth of its baud rate in bytes per second. The kernel buffers 4096 bytes, which is
0.7 s at 57600 baud: a message behind a full buffer arrives outdated. No message is therefore begun
while the backlog exceeds `MAX_BACKLOG_S`. A message that does not fit is dropped as a whole;
periodic messages such as setpoints follow with fresh content. A begun message is completed before
the next one.
"""

import math
from typing import Protocol

BITS_PER_BYTE = 10
"""Bits on the line per byte: a start bit, eight data bits, a stop bit."""
MAX_BACKLOG_S = 0.1
"""Maximum backlog before a message, s.

Chosen: two ticks of the control loop, and half of the minimum of `link.setpoint_loss_s`.
"""


class Port(Protocol):
    """An open port."""

    @property
    def in_waiting(self) -> int:
        """Number of received bytes that are not read yet."""
        ...

    @property
    def out_waiting(self) -> int:
        """Number of accepted bytes that are not sent yet; 0 if the driver does not report it."""
        ...

    def read(self, size: int = 1) -> bytes: ...

    def write(self, data: bytes) -> int:
        """Write without blocking; returns the number of accepted bytes."""
        ...

    def close(self) -> None: ...


class SerialLine:
    """Sending side of an open port; time is an argument."""

    def __init__(self, port: Port, baud: int) -> None:
        self._port = port
        self._bytes_per_s = baud / BITS_PER_BYTE
        self._free_s = -math.inf
        """Time at which all accepted bytes are sent at the baud rate."""
        self._rest = b""
        """Remaining bytes of a begun message."""
        self._begun_s = -math.inf

    def send(self, data: bytes, now_s: float, *, is_urgent: bool) -> bool:
        """Begin a message; returns False if it is dropped.

        A message that is not urgent must leave room for urgent ones.

        Raises:
            OSError: the port is disconnected.
        """
        self._finish(now_s)
        own_s = 0.0 if is_urgent else len(data) / self._bytes_per_s
        if self._rest or self._backlog_s(now_s) + own_s > MAX_BACKLOG_S:
            return False
        self._rest, self._begun_s = data, now_s
        self._put(now_s)
        if len(self._rest) == len(data):
            self._rest = b""
            return False
        return True

    def _finish(self, now_s: float) -> None:
        """Continue a begun message; one that is too old is corrupted, so the receiver drops it."""
        if self._rest and now_s - self._begun_s > MAX_BACKLOG_S:
            self._rest, self._begun_s = bytes(byte ^ 0xFF for byte in self._rest), math.inf
        self._put(now_s)

    def _put(self, now_s: float) -> None:
        while self._rest and (taken := self._port.write(self._rest)) > 0:
            self._rest = self._rest[taken:]
            self._free_s = max(self._free_s, now_s) + taken / self._bytes_per_s

    def _backlog_s(self, now_s: float) -> float:
        """Backlog in s, from the driver or from the accepted bytes: some drivers report 0."""
        return max(self._free_s - now_s, self._port.out_waiting / self._bytes_per_s)

"""What goes over one serial port: whole messages, and none behind bytes that are old.

A UART sends a tenth of its baud rate in bytes a second. The kernel takes 4096 bytes at once, which
at 57600 baud is 0.7 s: what is put behind them gets there when it is out of date. So no message is
begun behind more than `MAX_BACKLOG_S` of bytes. What does not fit is dropped whole; what comes
again, as setpoints do, is fresh the next time. A message that was begun is finished before
anything else.
"""

import math
from typing import Protocol

BITS_PER_BYTE = 10
"""A start bit, eight of data, a stop bit."""
MAX_BACKLOG_S = 0.1
"""Two ticks of the control loop, and half of the least `link.setpoint_loss_s`."""


class Port(Protocol):
    """An open port."""

    @property
    def in_waiting(self) -> int:
        """Bytes that have come in."""
        ...

    @property
    def out_waiting(self) -> int:
        """Bytes that were taken and have not left, as far as the driver tells; else 0."""
        ...

    def read(self, size: int = 1) -> bytes: ...

    def write(self, data: bytes) -> int:
        """How many of the bytes were taken; never waits."""
        ...

    def close(self) -> None: ...


class SerialLine:
    """One open port, to send; time is an argument."""

    def __init__(self, port: Port, baud: int) -> None:
        self._port = port
        self._bytes_per_s = baud / BITS_PER_BYTE
        self._free_s = -math.inf
        """When all that was taken has left, if it leaves at the baud rate."""
        self._rest = b""
        """Of a message that was begun."""
        self._begun_s = -math.inf

    def send(self, data: bytes, now_s: float, *, is_urgent: bool) -> bool:
        """Whether the message was begun; one that is not urgent must leave room for those that are.

        Raises:
            OSError: the port is gone.
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
        """Too late, the rest is spoilt: whole, the receiver would take an old message for new."""
        if self._rest and now_s - self._begun_s > MAX_BACKLOG_S:
            self._rest, self._begun_s = bytes(byte ^ 0xFF for byte in self._rest), math.inf
        self._put(now_s)

    def _put(self, now_s: float) -> None:
        while self._rest and (taken := self._port.write(self._rest)) > 0:
            self._rest = self._rest[taken:]
            self._free_s = max(self._free_s, now_s) + taken / self._bytes_per_s

    def _backlog_s(self, now_s: float) -> float:
        """By the driver, or by what was taken: some drivers tell nothing."""
        return max(self._free_s - now_s, self._port.out_waiting / self._bytes_per_s)

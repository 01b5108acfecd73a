"""The served bus: bytes of one client's connection in, replies out. Sockets are elsewhere."""

from collections.abc import Callable

from companion.drivers.served_bus import (
    CLOCK_REPLY,
    CLOCK_REQUEST,
    OP_CLOCK,
    OP_TRANSFER,
    OP_WAIT,
    REPLY,
    REQUEST,
    STATUS_MALFORMED,
    STATUS_NO_ACKNOWLEDGE,
    STATUS_OK,
    WAIT_S,
)
from sitl.sensors.i2c import DeviceBus

Clock = Callable[[float, int, int], tuple[float, int]]
"""(target_s, client's UDP port, datagrams it sent) -> (time reached, datagrams sent to it)."""

LONGEST_TRANSFER = 256
LONGEST_WAIT_S = 1.0
LONGEST_CLOCK_STEP_S = 60.0


class BusConnection:
    """One client; `closing` says that it has sent nonsense and is to be hung up on."""

    def __init__(self, bus: DeviceBus, clock: Clock, now_s: Callable[[], float]) -> None:
        self._bus = bus
        self._clock = clock
        self._now_s = now_s
        self._buffer = b""
        self.closing = False

    def feed(self, data: bytes) -> bytes:
        """Decode what has come so far; the replies to all whole requests in it."""
        self._buffer += data
        replies = b""
        while not self.closing and len(self._buffer) >= REQUEST.size:
            op, address, length, count = REQUEST.unpack_from(self._buffer)
            if max(length, count) > LONGEST_TRANSFER:
                replies += self._refuse()
                break
            end = REQUEST.size + length
            if len(self._buffer) < end:
                break
            payload, self._buffer = self._buffer[REQUEST.size : end], self._buffer[end:]
            replies += self._serve(op, address, payload, count)
        return replies

    def _serve(self, op: int, address: int, payload: bytes, count: int) -> bytes:
        if op == OP_TRANSFER:
            try:
                answer = self._bus.write_read(address, payload, count)
            except OSError:
                return REPLY.pack(STATUS_NO_ACKNOWLEDGE, 0)
            return REPLY.pack(STATUS_OK, len(answer)) + answer
        if op == OP_WAIT and len(payload) == WAIT_S.size:
            (duration_s,) = WAIT_S.unpack(payload)
            if 0 <= duration_s <= LONGEST_WAIT_S:
                self._bus.wait(duration_s)
                return b""
        if op == OP_CLOCK and len(payload) == CLOCK_REQUEST.size:
            target_s, port, sent = CLOCK_REQUEST.unpack(payload)
            if target_s - self._now_s() <= LONGEST_CLOCK_STEP_S:  # false for NaN too
                answer = CLOCK_REPLY.pack(*self._clock(target_s, port, sent))
                return REPLY.pack(STATUS_OK, len(answer)) + answer
        return self._refuse()

    def _refuse(self) -> bytes:
        self.closing = True
        return REPLY.pack(STATUS_MALFORMED, 0)

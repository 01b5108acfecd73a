"""The served bus: bytes of one client's connection in, replies out. Sockets are elsewhere."""

from collections.abc import Callable

from companion.drivers.bus import Transaction
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
    TRANSACTION,
    WAIT_S,
)
from sitl.sensors.i2c import DeviceBus

Clock = Callable[[float, int, int], tuple[float, int]]
"""(target_s, client's UDP port, datagrams it sent) -> (time reached, datagrams sent to it)."""

LONGEST_REQUEST = 4096
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
            op, length = REQUEST.unpack_from(self._buffer)
            if length > LONGEST_REQUEST:
                replies += self._refuse()
                break
            end = REQUEST.size + length
            if len(self._buffer) < end:
                break
            payload, self._buffer = self._buffer[REQUEST.size : end], self._buffer[end:]
            replies += self._serve(op, payload)
        return replies

    def _serve(self, op: int, payload: bytes) -> bytes:
        if op == OP_TRANSFER:
            return self._transfer(payload)
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

    def _transfer(self, payload: bytes) -> bytes:
        transactions = _decoded(payload)
        if transactions is None:
            return self._refuse()
        try:
            answer = b"".join(self._bus.transfer(transactions))
        except OSError:
            return REPLY.pack(STATUS_NO_ACKNOWLEDGE, 0)
        return REPLY.pack(STATUS_OK, len(answer)) + answer

    def _refuse(self) -> bytes:
        self.closing = True
        return REPLY.pack(STATUS_MALFORMED, 0)


def _decoded(payload: bytes) -> list[Transaction] | None:
    """The transactions of a TRANSFER; None if they do not fill it exactly."""
    transactions = []
    at = 0
    while at < len(payload):
        if len(payload) - at < TRANSACTION.size:
            return None
        address, length, count = TRANSACTION.unpack_from(payload, at)
        at += TRANSACTION.size
        if len(payload) - at < length:
            return None
        transactions.append(Transaction(address, payload[at : at + length], count))
        at += length
    return transactions

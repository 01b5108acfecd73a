"""Serves the wires: decodes one client's bytes and encodes the replies. It opens no socket."""

from collections.abc import Callable
from typing import NamedTuple

from companion.drivers.wires.bus import Transaction
from companion.drivers.wires.served_bus import (
    BAUD,
    CLOCK_REPLY,
    CLOCK_REQUEST,
    OP_CLOCK,
    OP_EXCHANGE,
    OP_RECEIVE,
    OP_TRANSFER,
    REPLY,
    REQUEST,
    STATUS_MALFORMED,
    STATUS_NO_ACKNOWLEDGE,
    STATUS_OK,
    TRANSACTION,
)
from sitl.sensors.i2c import DeviceBus


class ClockRequest(NamedTuple):
    """A client's request to wait for a time."""

    target_s: float
    udp_port: int
    """UDP port from which the client sends MAVLink."""
    datagrams: int
    """Datagrams that the client has sent from there."""


LONGEST_REQUEST = 4096
"""Largest payload of a request, bytes. Chosen."""
LONGEST_WAIT_S = 1.0
"""Longest wait within a transaction, s. Chosen."""
LONGEST_CLOCK_STEP_S = 60.0
"""Longest wait for the clock, s. Chosen."""


class BusConnection:
    """One client. `closing` is set after a malformed request: the connection must be closed."""

    def __init__(self, bus: DeviceBus, now_s: Callable[[], float]) -> None:
        self._bus = bus
        self._now_s = now_s
        self._buffer = b""
        self.waits_for: ClockRequest | None = None
        """A pending clock request; further requests wait until `reach` answers it."""
        self.closing = False

    def feed(self, data: bytes) -> bytes:
        """Take received bytes; return the replies to all complete requests."""
        self._buffer += data
        return self._serve_buffered()

    def reach(self, time_s: float, datagrams: int) -> bytes:
        """Answer the pending clock request and those received after it."""
        self.waits_for = None
        answer = CLOCK_REPLY.pack(time_s, datagrams)
        return REPLY.pack(STATUS_OK, len(answer)) + answer + self._serve_buffered()

    def _serve_buffered(self) -> bytes:
        replies = b""
        while not self.closing and not self.waits_for and len(self._buffer) >= REQUEST.size:
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
        if op == OP_EXCHANGE and payload and len(payload) > payload[0]:
            name, data = payload[1 : 1 + payload[0]], payload[1 + payload[0] :]
            return self._answer(lambda: self._bus.exchange(_text(name), data))
        if op == OP_RECEIVE and len(payload) >= BAUD.size:
            (baud,) = BAUD.unpack_from(payload)
            return self._answer(lambda: self._bus.receive(_text(payload[BAUD.size :]), baud))
        if op == OP_CLOCK and len(payload) == CLOCK_REQUEST.size:
            request = ClockRequest(*CLOCK_REQUEST.unpack(payload))
            if request.target_s - self._now_s() <= LONGEST_CLOCK_STEP_S:  # false for NaN too
                self.waits_for = request
                return b""
        return self._refuse()

    def _transfer(self, payload: bytes) -> bytes:
        transactions = _decoded(payload)
        if transactions is None:
            return self._refuse()
        return self._answer(lambda: b"".join(self._bus.transfer(transactions)))

    def _answer(self, ask: Callable[[], bytes]) -> bytes:
        try:
            answer = ask()
        except OSError:
            return REPLY.pack(STATUS_NO_ACKNOWLEDGE, 0)
        return REPLY.pack(STATUS_OK, len(answer)) + answer

    def _refuse(self) -> bytes:
        self.closing = True
        return REPLY.pack(STATUS_MALFORMED, 0)


def _text(name: bytes) -> str:
    return name.decode(errors="replace")


def _decoded(payload: bytes) -> list[Transaction] | None:
    """The transactions of a TRANSFER; None if malformed or if one waits too long."""
    transactions = []
    at = 0
    while at < len(payload):
        if len(payload) - at < TRANSACTION.size:
            return None
        address, length, count, wait_s = TRANSACTION.unpack_from(payload, at)
        at += TRANSACTION.size
        if len(payload) - at < length or not 0 <= wait_s <= LONGEST_WAIT_S:  # false for NaN too
            return None
        transactions.append(Transaction(address, payload[at : at + length], count, wait_s))
        at += length
    return transactions

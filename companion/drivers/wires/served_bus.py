"""Client of the wires and of the virtual clock that SITL serves over TCP.

Little-endian frames. Request: op, length, payload; reply: status, length, payload.

- TRANSFER, I2C: transactions (device address, length to write, length to read, seconds to wait
  afterwards, data to write); the reply contains all bytes read, in order.
- EXCHANGE, SPI: length of the device's name, the name, bytes to shift out; reply: bytes shifted in.
- RECEIVE, serial: the baud rate, the port's name; reply: bytes received.
"""

import errno
import socket
import struct
import time
from collections.abc import Callable, Sequence
from itertools import accumulate

from companion.core.errors import SensorError
from companion.drivers.wires.bus import Transaction

REQUEST = struct.Struct("<BH")
REPLY = struct.Struct("<BH")
TRANSACTION = struct.Struct("<BBBd")
CLOCK_REQUEST = struct.Struct("<dHQ")
"""Time to reach, s; the client's UDP port; MAVLink datagrams that it has sent."""
CLOCK_REPLY = struct.Struct("<dQ")
"""Time reached, s; MAVLink datagrams that SITL has sent."""

BAUD = struct.Struct("<I")

OP_TRANSFER, OP_CLOCK, OP_EXCHANGE, OP_RECEIVE = 1, 2, 3, 4
"""Operations of a request."""
STATUS_OK, STATUS_NO_ACKNOWLEDGE, STATUS_MALFORMED = 0, 1, 2
"""Status of a reply."""

REPLY_TIMEOUT_S = 5.0
"""Longest wait for a reply, s. Chosen."""
RETRY_PERIOD_S = 1.0
"""Interval of attempts to reconnect, s. Chosen."""


class _Connection:
    """One TCP connection that answers requests in order."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.create_connection((host, port), timeout=REPLY_TIMEOUT_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def post(self, op: int, payload: bytes) -> None:
        self._socket.sendall(REQUEST.pack(op, len(payload)) + payload)

    def wait_long(self) -> None:
        """Disable the timeout: with an external autopilot, time stops while that is silent."""
        self._socket.settimeout(None)

    def reply(self) -> tuple[int, bytes]:
        status, length = REPLY.unpack(self._receive(REPLY.size))
        return status, self._receive(length)

    def _receive(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            more = self._socket.recv(count - len(data))
            if not more:
                raise ConnectionResetError(errno.ECONNRESET, "sitl closed the connection")
            data += more
        return data

    def close(self) -> None:
        self._socket.close()


def _refused(host: str, port: int, error: OSError) -> SensorError:
    return SensorError(
        f"nothing serves sitl://{host}:{port} ({error.strerror or error}); "
        "start the simulator first: sitl run room_100"
    )


def _addresses(transactions: Sequence[Transaction]) -> str:
    return " or ".join(f"0x{address:02x}" for address in sorted({t.address for t in transactions}))


class ServedBus:
    """Wires behind a socket; a broken connection is retried once a second."""

    def __init__(self, host: str, port: int) -> None:
        self._address = host, port
        self._retry_at_s = 0.0
        try:
            self._connection: _Connection | None = _Connection(host, port)
        except OSError as error:
            raise _refused(host, port, error) from error

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        request = b"".join(
            TRANSACTION.pack(t.address, len(t.data), t.count, t.wait_s) + t.data
            for t in transactions
        )
        answer = self._request(OP_TRANSFER, request, lambda: _addresses(transactions))
        ends = accumulate(t.count for t in transactions)
        return [answer[end - t.count : end] for t, end in zip(transactions, ends, strict=True)]

    def exchange(self, device: str, data: bytes) -> bytes:
        name = device.encode()
        return self._request(OP_EXCHANGE, bytes([len(name)]) + name + data, lambda: device)

    def receive(self, port: str, baud: int) -> bytes:
        return self._request(OP_RECEIVE, BAUD.pack(baud) + port.encode(), lambda: port)

    def _request(self, op: int, request: bytes, whom: Callable[[], str]) -> bytes:
        connection = self._connected()
        try:
            connection.post(op, request)
            status, answer = connection.reply()
        except OSError:
            self._drop()
            raise
        if status != STATUS_OK:
            raise OSError(errno.EREMOTEIO, f"no answer from {whom()}")
        return answer

    def _connected(self) -> _Connection:
        if self._connection is None:
            if time.monotonic() < self._retry_at_s:
                raise ConnectionError(errno.ENOTCONN, "the served bus is disconnected")
            self._retry_at_s = time.monotonic() + RETRY_PERIOD_S
            self._connection = _Connection(*self._address)
        return self._connection

    def _drop(self) -> None:
        self.close()
        self._retry_at_s = time.monotonic() + RETRY_PERIOD_S

    def close(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None


class VirtualClock:
    """SITL's time, served beside the bus on a connection of its own."""

    def __init__(self, host: str, port: int) -> None:
        self._address = host, port
        try:
            self._connection = _Connection(host, port)
        except OSError as error:
            raise _refused(host, port, error) from error
        self._connection.wait_long()

    def advance_to(self, time_s: float, udp_port: int, datagrams_sent: int) -> tuple[float, int]:
        """Let the simulation reach a time; returns the time reached, and the datagrams sent to us.

        Raises:
            SensorError: the connection to SITL is lost.
        """
        try:
            request = CLOCK_REQUEST.pack(time_s, udp_port, datagrams_sent)
            self._connection.post(OP_CLOCK, request)
            _, answer = self._connection.reply()
            reached_s, datagrams = CLOCK_REPLY.unpack(answer)
        except (OSError, struct.error) as error:
            self._connection.close()
            raise SensorError(f"sitl's clock is gone ({error})") from error
        return reached_s, datagrams

    def close(self) -> None:
        self._connection.close()

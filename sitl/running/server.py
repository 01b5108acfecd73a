"""Serves vehicles to other processes: MAVLink on UDP, each vehicle's bus on TCP (`sitl run`).

One thread runs one loop. While companions request virtual time, the simulation advances to the
earliest requested time, at most at `speed` times real time. Without requests, for example with only
a ground station connected, it runs in real time. In `lockstep` mode time advances only when every
vehicle's companion requests it, so that a flight is bit-identical at any speed. A companion that
has disconnected is not waited for.
"""

import math
import selectors
import socket
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from companion.link.transports.transport import UdpTransport
from sitl.core.errors import SitlError
from sitl.sensors.i2c import DeviceBus
from sitl.sensors.server import BusConnection

UNATTENDED_AFTER_S = 0.5
"""A companion is not waited for after this wall time without a clock request, s. Chosen."""
FREE_RUN_STEP_S = 0.01
"""Smallest step without requests, s."""
DATAGRAM_TIMEOUT_S = 1.0
"""Longest wait for announced datagrams, s. Chosen."""
TIME_TOLERANCE_S = 1e-9
"""Tolerance for rounding when a requested time is reached, s. Chosen."""


class Served(Protocol):
    """Interface of the served object: its time can be advanced."""

    @property
    def time_s(self) -> float: ...

    def advance(self, time_s: float) -> None: ...


class Attendance(Protocol):
    """Observes how well a companion keeps up. The first argument of each method is wall time, s."""

    def asked(self, now_s: float, worked_s: float, time_s: float, wanted_s: float) -> None: ...

    def reached(self, now_s: float, stepping_s: float, time_s: float) -> None: ...


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Sensor bus and links of one vehicle."""

    bus: DeviceBus
    listener: socket.socket
    transports: Sequence[UdpTransport]

    @property
    def bus_port(self) -> int:
        port: int = self.listener.getsockname()[1]
        return port

    def transport_of(self, udp_port: int) -> UdpTransport | None:
        """The link of a companion with this port; the first one before its first message."""
        known = [t for t in self.transports if t.peer_port == udp_port]
        return next(iter([*known, *self.transports]), None)


@dataclass(slots=True)
class _Client:
    socket: socket.socket
    connection: BusConnection
    endpoint: Endpoint
    asked_s: float = -math.inf
    """Wall time of its last clock request, s."""


class Pace:
    """Limits simulated time to `speed` times the wall clock since the latest `resume`."""

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self.resume(0.0)

    def resume(self, sim_s: float) -> None:
        self._wall_s, self._sim_s = time.monotonic(), sim_s

    def due_s(self, speed: float | None = None) -> float:
        """The simulated time allowed now, s."""
        return self._sim_s + (time.monotonic() - self._wall_s) * (speed or self._speed)

    def hold_back(self, sim_s: float) -> None:
        time.sleep(max(0.0, (sim_s - self.due_s()) / self._speed))


class Server:
    """The event loop; a signal handler calls `stop`."""

    def __init__(
        self,
        served: Served,
        endpoints: Sequence[Endpoint],
        *,
        speed: float,
        lockstep: bool = False,
        attendance: Attendance | None = None,
    ) -> None:
        self._served = served
        self._attendance = attendance
        self._lockstep = lockstep
        self._pace = Pace(speed)
        self._clients: list[_Client] = []
        self._unattended = list(endpoints)
        """Endpoints without a clock request and without a client that has left, so far."""
        self._attended_s = -UNATTENDED_AFTER_S
        self.attended_for_s = 0.0
        """Wall time from the first clock request to the last answer, s."""
        self._first_request_s: float | None = None
        self._selector = selectors.DefaultSelector()
        for endpoint in endpoints:
            self._selector.register(endpoint.listener, selectors.EVENT_READ, endpoint)
        self._running = True

    def stop(self) -> None:
        self._running = False

    def serve(self, watch: Callable[[float], None] = lambda time_s: None) -> None:
        """Run until stopped; `watch` gets the simulated time in each pass, s."""
        try:
            while self._running:
                for key, _ in self._selector.select(FREE_RUN_STEP_S):
                    if isinstance(key.data, Endpoint):
                        self._accept(key.data)
                    else:
                        self._receive(key.data)
                self._advance_attended()
                if not self._lockstep:
                    self._run_unattended()
                watch(self._served.time_s)
        finally:
            for key in list(self._selector.get_map().values()):
                key.fileobj.close()  # type: ignore[union-attr]
            self._selector.close()

    def _accept(self, endpoint: Endpoint) -> None:
        try:
            client_socket, _ = endpoint.listener.accept()
        except OSError:  # the client has already closed the connection
            return
        client_socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection = BusConnection(endpoint.bus, lambda: self._served.time_s)
        client = _Client(client_socket, connection, endpoint)
        self._clients.append(client)
        self._selector.register(client_socket, selectors.EVENT_READ, client)

    def _receive(self, client: _Client) -> None:
        try:
            data = client.socket.recv(65536)
        except OSError:
            data = b""
        if not data:
            self._drop(client)
            return
        self._send(client, client.connection.feed(data))
        if client.connection.waits_for:
            client.asked_s = time.monotonic()
            self._no_longer_await(client.endpoint)

    def _no_longer_await(self, endpoint: Endpoint) -> None:
        self._unattended = [each for each in self._unattended if each is not endpoint]

    def _send(self, client: _Client, replies: bytes) -> None:
        try:
            client.socket.sendall(replies)
        except OSError:
            self._drop(client)
        else:
            if client.connection.closing:
                self._drop(client)

    def _drop(self, client: _Client) -> None:
        if client in self._clients:
            self._clients.remove(client)
            self._no_longer_await(client.endpoint)
            self._selector.unregister(client.socket)
            client.socket.close()

    def _advance_attended(self) -> None:
        """Advance to the earliest time that all attending clients have requested."""
        now_s = time.monotonic()
        waiting = [client for client in self._clients if client.connection.waits_for]
        attending = [client for client in self._clients if self._attends(client, now_s)]
        if not waiting or not all(client in waiting for client in attending):
            return
        if self._lockstep and self._unattended:
            return
        self._first_request_s = self._first_request_s or now_s
        if now_s - self._attended_s > UNATTENDED_AFTER_S:
            self._pace.resume(self._served.time_s)
        for client in waiting:
            self._await_datagrams(client)
        requests = [client.connection.waits_for for client in waiting]
        target_s = min(request.target_s for request in requests if request)
        self._advance(target_s)
        self._pace.hold_back(self._served.time_s)
        self._attended_s = time.monotonic()
        self.attended_for_s = self._attended_s - self._first_request_s
        for client in waiting:
            self._answer(client)

    def _attends(self, client: _Client, now_s: float) -> bool:
        """True if time waits for this client.

        In lockstep it waits for the last client of each vehicle that has requested a time, until
        that client disconnects.
        """
        if now_s - client.asked_s <= UNATTENDED_AFTER_S:
            return True
        latest_s = max(c.asked_s for c in self._clients if c.endpoint is client.endpoint)
        return self._lockstep and -math.inf < client.asked_s == latest_s

    def _advance(self, target_s: float) -> None:
        served, attendance, began_s = self._served, self._attendance, time.monotonic()
        if attendance is not None:
            worked_s = began_s - self._attended_s
            attendance.asked(began_s, worked_s, served.time_s, target_s)
        busy_s = time.process_time()
        served.advance(max(target_s, served.time_s))
        if attendance is not None:
            stepping_s = time.process_time() - busy_s
            attendance.reached(time.monotonic(), stepping_s, served.time_s)

    def _await_datagrams(self, client: _Client) -> None:
        """Receive the datagrams that the companion sent before its request."""
        request = client.connection.waits_for
        transport = client.endpoint.transport_of(request.udp_port) if request else None
        if request and transport:
            transport.await_datagrams(request.datagrams, DATAGRAM_TIMEOUT_S)

    def _answer(self, client: _Client) -> None:
        request, now_s = client.connection.waits_for, self._served.time_s
        client.asked_s = self._attended_s
        if request is None or request.target_s > now_s + TIME_TOLERANCE_S:
            return
        transport = client.endpoint.transport_of(request.udp_port)
        sent = transport.datagrams_sent if transport else 0
        self._send(client, client.connection.reach(now_s, sent))

    def _run_unattended(self) -> None:
        if time.monotonic() - self._attended_s <= UNATTENDED_AFTER_S:
            self._pace.resume(self._served.time_s)
            return
        behind_s = self._pace.due_s(speed=1.0) - self._served.time_s
        if behind_s <= -FREE_RUN_STEP_S:  # the served object has its own time
            self._pace.resume(self._served.time_s)
        elif behind_s >= FREE_RUN_STEP_S:
            self._served.advance(self._served.time_s + behind_s)


def listen(port: int) -> socket.socket:
    """Listen on a TCP port on loopback; 0 selects a free one.

    Raises:
        SitlError: the port is taken.
    """
    try:
        return socket.create_server(("127.0.0.1", port))
    except OSError as error:
        raise SitlError(
            f"port {port}: {error.strerror}; another sitl may be running, or choose --bus-port"
        ) from error

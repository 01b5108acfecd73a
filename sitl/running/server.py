"""`sitl run`: vehicles served to other processes, MAVLink on UDP and each one's bus on TCP.

One thread, one loop. While companions ask for virtual time, the simulation goes exactly as far as
the most cautious of them asks it to, and no faster than `speed` times real time. While nobody
asks, for example with only a ground station connected, it runs by itself in real time; unless it
is run `lockstep`, where time stands still until every vehicle's companion asks, so that a flight
is the same to the bit however it is flown.
"""

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
"""Wall time after its last request for time from which a companion is not waited for."""
FREE_RUN_STEP_S = 0.01
DATAGRAM_TIMEOUT_S = 1.0
TIME_TOLERANCE_S = 1e-9


class Served(Protocol):
    """What a server serves: time that it can let pass."""

    @property
    def time_s(self) -> float: ...

    def advance(self, time_s: float) -> None: ...


class Attendance(Protocol):
    """Looks at how well a companion that asks for time keeps up; the first of each is wall time."""

    def asked(self, now_s: float, worked_s: float, time_s: float, wanted_s: float) -> None: ...

    def reached(self, now_s: float, stepping_s: float, time_s: float) -> None: ...


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Where one vehicle's companion comes in."""

    bus: DeviceBus
    listener: socket.socket
    transports: Sequence[UdpTransport]

    @property
    def bus_port(self) -> int:
        port: int = self.listener.getsockname()[1]
        return port

    def transport_of(self, udp_port: int) -> UdpTransport | None:
        """The link that a companion with this port is on; the first if it has not spoken yet."""
        known = [t for t in self.transports if t.peer_port == udp_port]
        return next(iter([*known, *self.transports]), None)


@dataclass(slots=True)
class _Client:
    socket: socket.socket
    connection: BusConnection
    door: Endpoint
    asked_s: float = float("-inf")
    """Wall time of its last request for time."""


class Pace:
    """Holds simulated time back to `speed` times the wall clock, from the latest resume."""

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self.resume(0.0)

    def resume(self, sim_s: float) -> None:
        self._wall_s, self._sim_s = time.monotonic(), sim_s

    def due_s(self, speed: float | None = None) -> float:
        """The simulated time that the wall clock allows now."""
        return self._sim_s + (time.monotonic() - self._wall_s) * (speed or self._speed)

    def hold_back(self, sim_s: float) -> None:
        time.sleep(max(0.0, (sim_s - self.due_s()) / self._speed))


class Server:
    """The event loop; `stop` from a signal handler ends it."""

    def __init__(
        self,
        served: Served,
        doors: Sequence[Endpoint],
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
        self._unmet = list(doors)
        """Nobody has asked for time here yet."""
        self._attended_s = -UNATTENDED_AFTER_S
        self.attended_for_s = 0.0
        """Wall time from the first request for time to the last answer."""
        self._met_s: float | None = None
        self._selector = selectors.DefaultSelector()
        for door in doors:
            self._selector.register(door.listener, selectors.EVENT_READ, door)
        self._running = True

    def stop(self) -> None:
        self._running = False

    def serve(self, watch: Callable[[float], None] = lambda time_s: None) -> None:
        """Run until stopped; `watch` is told the simulated time about ten times a second."""
        try:
            while self._running:
                for key, _ in self._selector.select(FREE_RUN_STEP_S):
                    if isinstance(key.data, Endpoint):
                        self._accept(key.data)
                    else:
                        self._hear(key.data)
                self._let_time_pass()
                if not self._lockstep:
                    self._run_unattended()
                watch(self._served.time_s)
        finally:
            for key in list(self._selector.get_map().values()):
                key.fileobj.close()  # type: ignore[union-attr]
            self._selector.close()

    def _accept(self, door: Endpoint) -> None:
        try:
            client_socket, _ = door.listener.accept()
        except OSError:  # it has hung up already
            return
        client_socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection = BusConnection(door.bus, lambda: self._served.time_s)
        client = _Client(client_socket, connection, door)
        self._clients.append(client)
        self._selector.register(client_socket, selectors.EVENT_READ, client)

    def _hear(self, client: _Client) -> None:
        try:
            data = client.socket.recv(65536)
        except OSError:
            data = b""
        if not data:
            self._drop(client)
            return
        self._tell(client, client.connection.feed(data))
        if client.connection.waits_for:
            client.asked_s = time.monotonic()
            self._unmet = [door for door in self._unmet if door is not client.door]

    def _tell(self, client: _Client, replies: bytes) -> None:
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
            self._selector.unregister(client.socket)
            client.socket.close()

    def _let_time_pass(self) -> None:
        """As far as everybody who attends has asked for."""
        now_s = time.monotonic()
        waiting = [client for client in self._clients if client.connection.waits_for]
        attending = [c for c in self._clients if now_s - c.asked_s <= UNATTENDED_AFTER_S]
        if not waiting or not all(client in waiting for client in attending):
            return
        if self._lockstep and self._unmet:
            return
        self._met_s = self._met_s or now_s
        if now_s - self._attended_s > UNATTENDED_AFTER_S:
            self._pace.resume(self._served.time_s)
        for client in waiting:
            self._await_datagrams(client)
        requests = [client.connection.waits_for for client in waiting]
        target_s = min(request.target_s for request in requests if request)
        self._advance(target_s)
        self._pace.hold_back(self._served.time_s)
        self._attended_s = time.monotonic()
        self.attended_for_s = self._attended_s - self._met_s
        for client in waiting:
            self._answer(client)

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
        """Take in what the companion has sent before it asked."""
        request = client.connection.waits_for
        transport = client.door.transport_of(request.udp_port) if request else None
        if request and transport:
            transport.await_datagrams(request.datagrams, DATAGRAM_TIMEOUT_S)

    def _answer(self, client: _Client) -> None:
        request, now_s = client.connection.waits_for, self._served.time_s
        client.asked_s = self._attended_s
        if request is None or request.target_s > now_s + TIME_TOLERANCE_S:
            return
        transport = client.door.transport_of(request.udp_port)
        sent = transport.datagrams_sent if transport else 0
        self._tell(client, client.connection.reach(now_s, sent))

    def _run_unattended(self) -> None:
        if time.monotonic() - self._attended_s <= UNATTENDED_AFTER_S:
            self._pace.resume(self._served.time_s)
            return
        behind_s = self._pace.due_s(speed=1.0) - self._served.time_s
        if behind_s <= -FREE_RUN_STEP_S:  # what is served has a time of its own
            self._pace.resume(self._served.time_s)
        elif behind_s >= FREE_RUN_STEP_S:
            self._served.advance(self._served.time_s + behind_s)


def listen(port: int) -> socket.socket:
    """A TCP port on loopback; 0 takes a free one.

    Raises:
        SitlError: it is taken.
    """
    try:
        return socket.create_server(("127.0.0.1", port))
    except OSError as error:
        raise SitlError(
            f"port {port}: {error.strerror}; another sitl may be running, or choose --bus-port"
        ) from error

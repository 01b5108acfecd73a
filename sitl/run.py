"""`sitl run`: the simulation served to other processes, MAVLink on UDP and the bus on TCP.

One thread, one loop. While a companion asks for virtual time, the simulation goes exactly as far
as it is asked to, and no faster than `speed` times real time. While nobody asks, for example with
only a ground station connected, it runs by itself in real time; unless it is run `lockstep`, where
time stands still until somebody asks, so that a flight is the same to the bit however it is flown.
"""

import selectors
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass

from companion.link.transport import UdpTransport
from sitl.errors import SitlError
from sitl.sensors.server import BusConnection
from sitl.simulation import Simulation

UNATTENDED_AFTER_S = 0.5
"""Wall time after the last request for time from which the simulation runs by itself."""
FREE_RUN_STEP_S = 0.01
DATAGRAM_TIMEOUT_S = 1.0


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


@dataclass(frozen=True, slots=True)
class _Client:
    socket: socket.socket
    connection: BusConnection


class Server:
    """The event loop; `stop` from a signal handler ends it."""

    def __init__(
        self,
        simulation: Simulation,
        transport: UdpTransport,
        *,
        bus_port: int,
        speed: float,
        lockstep: bool = False,
    ) -> None:
        self._simulation = simulation
        self._transport = transport
        self._lockstep = lockstep
        self._pace = Pace(speed)
        self._attended_s = -UNATTENDED_AFTER_S
        self._selector = selectors.DefaultSelector()
        self._listener = _listen(bus_port)
        self._selector.register(self._listener, selectors.EVENT_READ, None)
        self._running = True

    @property
    def bus_port(self) -> int:
        port: int = self._listener.getsockname()[1]
        return port

    def stop(self) -> None:
        self._running = False

    def serve(self, watch: Callable[[float], None] = lambda time_s: None) -> None:
        """Run until stopped; `watch` is told the simulated time about ten times a second."""
        try:
            while self._running:
                for key, _ in self._selector.select(FREE_RUN_STEP_S):
                    self._accept() if key.data is None else self._serve_client(key.data)
                if not self._lockstep:
                    self._run_unattended()
                watch(self._simulation.time_s)
        finally:
            for key in list(self._selector.get_map().values()):
                key.fileobj.close()  # type: ignore[union-attr]
            self._selector.close()

    def _accept(self) -> None:
        client_socket, _ = self._listener.accept()
        client_socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection = BusConnection(
            self._simulation.board.bus, self._clock, lambda: self._simulation.time_s
        )
        client = _Client(client_socket, connection)
        self._selector.register(client_socket, selectors.EVENT_READ, client)

    def _serve_client(self, client: _Client) -> None:
        try:
            data = client.socket.recv(65536)
            if data:
                client.socket.sendall(client.connection.feed(data))
        except OSError:
            data = b""
        if not data or client.connection.closing:
            self._selector.unregister(client.socket)
            client.socket.close()

    def _clock(self, target_s: float, udp_port: int, datagrams: int) -> tuple[float, int]:
        """A companion asks for a time: take in what it has sent, then let that time come."""
        now_s = time.monotonic()
        if now_s - self._attended_s > UNATTENDED_AFTER_S:
            self._pace.resume(self._simulation.time_s)
        self._transport.await_datagrams(datagrams, DATAGRAM_TIMEOUT_S)
        self._simulation.advance(max(target_s, self._simulation.time_s))
        self._pace.hold_back(self._simulation.time_s)
        self._attended_s = time.monotonic()
        return self._simulation.time_s, self._transport.datagrams_sent

    def _run_unattended(self) -> None:
        if time.monotonic() - self._attended_s <= UNATTENDED_AFTER_S:
            self._pace.resume(self._simulation.time_s)
            return
        behind_s = self._pace.due_s(speed=1.0) - self._simulation.time_s
        if behind_s >= FREE_RUN_STEP_S:
            self._simulation.advance(self._simulation.time_s + behind_s)


def _listen(port: int) -> socket.socket:
    try:
        return socket.create_server(("127.0.0.1", port))
    except OSError as error:
        raise SitlError(
            f"port {port}: {error.strerror}; another sitl may be running, or choose --bus-port"
        ) from error

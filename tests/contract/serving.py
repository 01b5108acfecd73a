"""Serves a bus on an ephemeral port from a thread of the test."""

import socket
import threading
from contextlib import suppress
from types import TracebackType

from sitl.sensors.i2c import DeviceBus
from sitl.sensors.server import BusConnection


class Served:
    """Serves one bus within the context; leaving it closes all connections."""

    def __init__(self, bus: DeviceBus, port: int = 0) -> None:
        self._bus = bus
        self._listener = socket.create_server(("127.0.0.1", port))
        self._clients: list[socket.socket] = []
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self.port: int = self._listener.getsockname()[1]

    def __enter__(self) -> "Served":
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for client in self._clients:
            with suppress(OSError):  # the client has already closed the connection
                client.shutdown(socket.SHUT_RDWR)
        self._thread.join(5)

    def _accept(self) -> None:
        threads = []
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                break
            self._clients.append(client)
            threads.append(threading.Thread(target=self._serve, args=(client,), daemon=True))
            threads[-1].start()
        for thread in threads:
            thread.join(5)

    def _serve(self, client: socket.socket) -> None:
        connection = BusConnection(self._bus, lambda: 0.0)
        with client:
            while data := client.recv(4096):
                client.sendall(connection.feed(data))

"""Starts the process that flies, restarts it if it dies, and exchanges orders and news with it."""

import multiprocessing
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess

from sitl.view.flight.flying import serve
from sitl.view.flight.messages import News, Order, Refused

END_TIMEOUT_S = 5.0
"""Longest wait for the process to end, s. Chosen."""
_SPAWN = multiprocessing.get_context("spawn")
"""Spawned, because the page's process has threads and must not be forked."""


class FlightProcess:
    """The flight's process. `on_news` is called in a separate thread and must return quickly."""

    def __init__(self, on_news: Callable[[News], None]) -> None:
        self._on_news = on_news
        self._lock = threading.Lock()
        self._is_closing = False
        self._open()

    def _open(self) -> None:
        ours, theirs = _SPAWN.Pipe()
        self._orders: Connection = ours
        self._process: SpawnProcess = _SPAWN.Process(target=serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        self._listener = threading.Thread(target=self._listen, args=(ours,), daemon=True)
        self._listener.start()

    def order(self, order: Order) -> None:
        with self._lock:
            if not self._process.is_alive():
                self._orders.close()
                self._open()
            self._orders.send(order)

    def _listen(self, connection: Connection) -> None:
        try:
            while True:
                self._on_news(connection.recv())
        except (EOFError, OSError):
            if not self._is_closing:
                self._on_news(Refused("the flight's process has ended; start the flight again"))

    def close(self) -> None:
        self._is_closing = True
        with self._lock:
            self._process.terminate()
            self._process.join(END_TIMEOUT_S)
            self._listener.join(END_TIMEOUT_S)
            self._orders.close()

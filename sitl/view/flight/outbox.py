"""Sends news to the page without waiting for it."""

import threading
from collections import deque
from dataclasses import replace
from multiprocessing.connection import Connection

from sitl.view.flight.messages import News, Seen, SeenDrone


class Outbox:
    """Sends news in a thread; a moment that was not sent in time is replaced by the next."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._waiting: deque[News] = deque()
        self._is_filled = threading.Condition()
        threading.Thread(target=self._send, daemon=True).start()

    def put(self, news: News) -> None:
        with self._is_filled:
            last = self._waiting[-1] if self._waiting else None
            if isinstance(last, Seen) and isinstance(news, Seen):
                self._waiting[-1] = later(last, news)
            else:
                self._waiting.append(news)
            self._is_filled.notify()

    def _send(self) -> None:
        while True:
            with self._is_filled:
                while not self._waiting:
                    self._is_filled.wait()
                news = self._waiting.popleft()
            try:
                self._connection.send(news)
            except OSError:  # the page has closed the connection
                return


def later(first: Seen | None, second: Seen) -> Seen:
    """The second moment, with the first one's map of each drone that has none."""
    if first is None or first.flight != second.flight:
        return second
    pairs = zip(first.drones, second.drones, strict=True)
    return replace(second, drones=tuple(_with_map(*pair) for pair in pairs))


def _with_map(first: SeenDrone, second: SeenDrone) -> SeenDrone:
    if second.snapshot.sketch is not None:
        return second
    return replace(second, snapshot=replace(second.snapshot, sketch=first.snapshot.sketch))

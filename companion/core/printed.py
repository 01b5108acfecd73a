"""Prints during a flight without blocking: a closed or stalled terminal does not affect the flight.

The control loop queues its lines, and a thread writes them. After a write error, such as a closed
pipe or a full disk, the rest is dropped.
"""

import io
import os
import select
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from queue import SimpleQueue
from typing import IO, TextIO, cast

from rich.console import Console

MAX_PENDING = 1000
"""Largest number of queued texts; a longer queue means that the reader has stalled. Chosen."""
CLOSE_TIMEOUT_S = 2.0
"""Time that the end of the program waits for the last lines, s. Chosen."""


class Printed(io.TextIOBase):
    """A text file over `stream` that never blocks and never raises."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._fd = stream.fileno()
        self._queue: SimpleQueue[bytes | threading.Event] = SimpleQueue()
        self._is_open = True
        threading.Thread(target=self._run, daemon=True).start()

    @property
    def encoding(self) -> str:  # type: ignore[override]
        return self._stream.encoding

    def isatty(self) -> bool:
        return self._stream.isatty()

    def fileno(self) -> int:
        return self._fd

    def write(self, text: str) -> int:
        if self._is_open and self._queue.qsize() < MAX_PENDING:
            self._queue.put(text.encode(self.encoding, "replace"))
        return len(text)

    def flush(self) -> None:
        """No action: the thread writes as soon as it can."""

    def drain(self) -> None:
        """Wait until the last lines are written, at most `CLOSE_TIMEOUT_S`."""
        is_drained = threading.Event()
        self._queue.put(is_drained)
        is_drained.wait(CLOSE_TIMEOUT_S)

    def _run(self) -> None:
        while True:
            item = self._queue.get()
            if isinstance(item, threading.Event):
                item.set()
            elif self._is_open:
                self._write(item)

    def _write(self, data: bytes) -> None:
        try:
            while data:
                select.select((), (self._fd,), ())  # the stream may be non-blocking
                data = data[os.write(self._fd, data) :]
        except (OSError, ValueError):
            self._is_open = False
            self._discard_output()

    def _discard_output(self) -> None:
        """Redirect the stream to the null device, so that Python exits without an error."""
        null_fd = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null_fd, self._fd)
        os.close(null_fd)


@contextmanager
def flight_console() -> Iterator[Console]:
    """A console on standard output that never blocks nor ends a flight."""
    try:
        printed = Printed(sys.stdout)
    except (AttributeError, OSError, ValueError):  # closed, missing, or in memory in a test
        yield Console(highlight=False, markup=False)
        return
    try:
        yield Console(highlight=False, markup=False, file=cast(IO[str], printed))
    finally:
        printed.drain()

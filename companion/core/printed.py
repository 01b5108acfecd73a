"""What is printed during a flight: a terminal that is gone, or stands still, does not matter to it.

The control loop hands its lines over and goes on. A thread writes them; once that has failed, as to
a closed pipe or a full disk, the rest is dropped.
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

MAX_WAITING = 1000
"""Pieces of text; a reader who is this far behind stands still."""
LAST_WORDS_S = 2.0
"""So long the end of the program waits for its last lines to be taken."""


class Printed(io.TextIOBase):
    """A text file over `stream` that never blocks and never raises."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._fd = stream.fileno()
        self._queue: SimpleQueue[bytes | threading.Event] = SimpleQueue()
        self._is_heard = True
        threading.Thread(target=self._run, daemon=True).start()

    @property
    def encoding(self) -> str:  # type: ignore[override]
        return self._stream.encoding

    def isatty(self) -> bool:
        return self._stream.isatty()

    def fileno(self) -> int:
        return self._fd

    def write(self, text: str) -> int:
        if self._is_heard and self._queue.qsize() < MAX_WAITING:
            self._queue.put(text.encode(self.encoding, "replace"))
        return len(text)

    def flush(self) -> None:
        """It is written as soon as it can be."""

    def say_all(self) -> None:
        """Wait for the last lines, but not for ever."""
        said = threading.Event()
        self._queue.put(said)
        said.wait(LAST_WORDS_S)

    def _run(self) -> None:
        while True:
            item = self._queue.get()
            if isinstance(item, threading.Event):
                item.set()
            elif self._is_heard:
                self._say(item)

    def _say(self, data: bytes) -> None:
        try:
            while data:
                select.select((), (self._fd,), ())  # it may have been opened not to block
                data = data[os.write(self._fd, data) :]
        except (OSError, ValueError):
            self._is_heard = False
            self._say_nothing_more()

    def _say_nothing_more(self) -> None:
        """Nor does Python stumble over it at its end."""
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._fd)
        os.close(nowhere)


@contextmanager
def flight_console() -> Iterator[Console]:
    """A console on the standard output that never holds up, nor ends, a flight."""
    try:
        printed = Printed(sys.stdout)
    except (AttributeError, OSError, ValueError):  # closed, none, or a test's, in memory
        yield Console(highlight=False, markup=False)
        return
    try:
        yield Console(highlight=False, markup=False, file=cast(IO[str], printed))
    finally:
        printed.say_all()

"""Writes in the background, because a medium may be slow, full, or block for ever."""

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class BackgroundWriter(Generic[T]):
    """Passes the latest content to `work` in a thread of its own; superseded content is dropped.

    It never raises. `trouble` is the error text of the latest attempt, empty after success.
    """

    def __init__(self, work: Callable[[T], object]) -> None:
        self._work = work
        self._pending: list[T] = []
        """Pending content: one entry or none."""
        self._is_writing = False
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self.trouble = ""

    def write(self, content: T) -> None:
        """Write this content after the present write."""
        with self._changed:
            self._pending = [content]
            self._changed.notify_all()
        if self._thread is None:
            thread = threading.Thread(target=self._run, daemon=True)
            try:
                thread.start()
            except RuntimeError as error:  # no more threads: tried again with the next content
                self.trouble = str(error)
                return
            self._thread = thread

    def wait(self, timeout_s: float) -> bool:
        """Wait until all content is written or has failed; False on timeout."""
        with self._changed:
            return self._changed.wait_for(
                lambda: not self._pending and not self._is_writing, timeout_s
            )

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: bool(self._pending))
                content = self._pending.pop()
                self._is_writing = True
            self.trouble = self._attempt(content)
            with self._changed:
                self._is_writing = False
                self._changed.notify_all()

    def _attempt(self, content: T) -> str:
        try:
            self._work(content)
        except Exception as error:  # no error here may end the flight
            return getattr(error, "strerror", None) or str(error) or repr(error)
        return ""

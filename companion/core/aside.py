"""Writing that the control loop does not wait for: a medium may be slow, full, or hang for good."""

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Aside(Generic[T]):
    """Gives `work` the latest content in a thread of its own; what is overtaken is left out.

    It never raises: `trouble` tells why the latest attempt has failed, or nothing.
    """

    def __init__(self, work: Callable[[T], object]) -> None:
        self._work = work
        self._waiting: list[T] = []
        """One, or none."""
        self._is_busy = False
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self.trouble = ""

    def give(self, content: T) -> None:
        """Have this written as soon as what is being written is done."""
        with self._changed:
            self._waiting = [content]
            self._changed.notify_all()
        if self._thread is None:
            thread = threading.Thread(target=self._run, daemon=True)
            try:
                thread.start()
            except RuntimeError as error:  # no more threads: tried again the next time
                self.trouble = str(error)
                return
            self._thread = thread

    def wait(self, timeout_s: float) -> bool:
        """Until all is written, or failed; whether it came to that in time."""
        with self._changed:
            return self._changed.wait_for(
                lambda: not self._waiting and not self._is_busy, timeout_s
            )

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: bool(self._waiting))
                content = self._waiting.pop()
                self._is_busy = True
            self.trouble = self._attempt(content)
            with self._changed:
                self._is_busy = False
                self._changed.notify_all()

    def _attempt(self, content: T) -> str:
        try:
            self._work(content)
        except Exception as error:  # whatever it is, it matters less than the flight
            return getattr(error, "strerror", None) or str(error) or repr(error)
        return ""

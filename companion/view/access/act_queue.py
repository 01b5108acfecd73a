"""Runs the actions of a page one at a time in one thread: input events and new data."""

import queue
import time
from collections.abc import Callable
from typing import Any

from viser import ClientHandle, GuiEvent, ViserServer

from companion.core.errors import CompanionError

FRAME_S = 0.05
"""Time between frames, s. Chosen."""
Act = Callable[[], None]
Event = GuiEvent[Any]


def nothing() -> None:
    """Do nothing in a frame."""


class ActQueue:
    """A queue of actions: any thread adds them, the thread of `run` executes them."""

    def __init__(
        self, server: ViserServer, refusals: tuple[type[Exception], ...] = (CompanionError,)
    ) -> None:
        """`refusals` are the errors that the page reports as a notification."""
        self._server = server
        self.refusals = refusals
        self._acts: queue.SimpleQueue[Act] = queue.SimpleQueue()

    def put(self, act: Act) -> None:
        self._acts.put(act)

    def pressed(self, act: Act) -> Callable[[Event], None]:
        """Wrap an action as a viser callback that ignores changes by the program itself."""

        def put_off(event: Event) -> None:
            if event.client is not None:  # None: the program changed the control
                self.put(lambda: self._try(act, event.client))

        return put_off

    def run(self, is_over: Callable[[], bool], each_frame: Act = nothing) -> None:
        """Execute actions until `is_over` returns True; call `each_frame` every `FRAME_S`."""
        frame_s = time.monotonic()
        while not is_over():
            try:
                self._acts.get(timeout=max(frame_s + FRAME_S - time.monotonic(), 0.0))()
            except queue.Empty:
                frame_s = time.monotonic()
                each_frame()

    def complain(self, reason: str, client: ClientHandle | None = None) -> None:
        """Show a notification to one client, or to all if `client` is None."""
        for receiver in [client] if client else self._server.get_clients().values():
            receiver.add_notification("Not possible", reason, color="red", auto_close_seconds=15)

    def _try(self, act: Act, client: ClientHandle | None) -> None:
        try:
            act()
        except self.refusals as error:
            self.complain(str(error), client)

"""What happens on a page, in turn: what people press and what news come, one act at a time."""

import queue
import time
from collections.abc import Callable
from typing import Any

from viser import ClientHandle, GuiEvent, ViserServer

from companion.core.errors import CompanionError

FRAME_S = 0.05
Act = Callable[[], None]
Event = GuiEvent[Any]


def nothing() -> None:
    """Between two acts."""


class Turns:
    """Acts are put here by any thread, and carried out by that of `run`."""

    def __init__(
        self, server: ViserServer, refusals: tuple[type[Exception], ...] = (CompanionError,)
    ) -> None:
        """`refusals` are errors in one line, which are told on the page."""
        self._server = server
        self._refusals = refusals
        self._acts: queue.SimpleQueue[Act] = queue.SimpleQueue()

    def put(self, act: Act) -> None:
        self._acts.put(act)

    def pressed(self, act: Act) -> Callable[[Event], None]:
        """A callback for viser: the act, when somebody has touched a control."""

        def put_off(event: Event) -> None:
            if event.client is not None:  # and not the program itself
                self.put(lambda: self._try(act, event.client))

        return put_off

    def run(self, is_over: Callable[[], bool], each_frame: Act = nothing) -> None:
        """Until it is over; `each_frame` twenty times a second."""
        frame_s = time.monotonic()
        while not is_over():
            try:
                self._acts.get(timeout=max(frame_s + FRAME_S - time.monotonic(), 0.0))()
            except queue.Empty:
                frame_s = time.monotonic()
                each_frame()

    def complain(self, reason: str, client: ClientHandle | None = None) -> None:
        """A notification; to everybody, if it is nobody's own."""
        for told in [client] if client else self._server.get_clients().values():
            told.add_notification("Not possible", reason, color="red", auto_close_seconds=15)

    def _try(self, act: Act, client: ClientHandle | None) -> None:
        try:
            act()
        except self._refusals as error:
            self.complain(str(error), client)

"""Shows the map and pose of a flying drone on the page, read-only."""

import time
from collections import deque
from collections.abc import Callable

from companion.view.access.act_queue import ActQueue
from companion.view.access.server import PageServer
from companion.view.feed_client import FeedClient
from companion.view.scene.instruments import PERIOD_S
from companion.view.scene.screen import Screen
from companion.view.snapshot import Snapshot

REMEMBERED = 700
"""Snapshots kept for the plots: 70 s at 10 Hz. Chosen: more than the plotted minute."""


class Live:
    """The page of a live flight.

    Raises:
        ViewError: the drone cannot be reached.
    """

    def __init__(self, server: PageServer, drone: tuple[str, int], token: str) -> None:
        self._server = server
        self._turns = ActQueue(server)
        self._screen = Screen(server)
        self._seen: deque[Snapshot] = deque(maxlen=REMEMBERED)
        self._heard_wall_s = self._plotted_wall_s = time.monotonic()
        gui = server.gui
        with gui.add_folder(f"Drone at {drone[0]}"):
            gui.add_markdown("Read-only: the page sends no commands to the drone.")
            bands = gui.add_slider("2σ bands ×", 1.0, 20.0, 1.0, 5.0)
            fit = gui.add_button("All in view")
        pressed = self._turns.pressed
        bands.on_update(pressed(lambda: self._screen.exaggerate(bands.value)))
        fit.on_click(pressed(self._screen.fit))
        self._looker = FeedClient(
            drone,
            token,
            lambda snapshot: self._turns.put(lambda: self._see(snapshot)),
            lambda reason: self._turns.put(lambda: self._turns.complain(reason)),
        )

    def run(self, is_over: Callable[[], bool]) -> None:
        """Update the page until `is_over` returns True."""
        self._turns.run(is_over)

    def close(self) -> None:
        self._looker.close()
        self._server.stop()

    def _see(self, snapshot: Snapshot) -> None:
        if self._seen and snapshot.time_s < self._seen[-1].time_s:
            self._seen.clear()  # another flight
        self._seen.append(snapshot)
        self._screen.show(snapshot)
        wall_s = time.monotonic()
        if wall_s - self._plotted_wall_s > PERIOD_S or snapshot.has_ended:
            self._plotted_wall_s = wall_s
            self._screen.plot(self._seen)

"""What systemd is told of a flight: that it is ready, how it goes, and that it is alive.

Datagrams to the socket that systemd names (sd_notify(3)). The watchdog is fed from the control
loop, so a loop that hangs is killed; the autopilot then stops by its own setpoint timeout.
"""

import os
import socket
import time
from collections.abc import Callable, Mapping

FEEDS_PER_TIMEOUT = 4
MAP_TIMEOUT_S = 120
"""The last smoothing of a long flight takes longer than a tick; by then it has landed."""


class Service:
    """Speaks to nobody when systemd has not started it."""

    def __init__(
        self,
        environment: Mapping[str, str] = os.environ,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._address = environment.get("NOTIFY_SOCKET", "").replace("@", "\0", 1)
        timeout_s = int(environment.get("WATCHDOG_USEC", 0)) * 1e-6
        self._feed_period_s = timeout_s / FEEDS_PER_TIMEOUT
        self._clock = clock
        self._fed_s = float("-inf")
        self._activity = ""

    def alive(self, activity: str) -> None:
        """Another tick of the control loop has passed."""
        now_s = self._clock()
        if activity != self._activity:
            first = "" if self._activity else "READY=1\n"
            self._activity = activity
            self._tell(f"{first}STATUS={activity}\n")
        if self._feed_period_s and now_s - self._fed_s >= self._feed_period_s:
            self._fed_s = now_s
            self._tell("WATCHDOG=1\n")

    def landed(self) -> None:
        """The loop has ended; what follows is the map."""
        self._tell(f"STATUS=saving the map\nWATCHDOG_USEC={MAP_TIMEOUT_S * 1_000_000}\n")

    def _tell(self, text: str) -> None:
        if not self._address:
            return
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as to_systemd:
                to_systemd.setblocking(False)  # the control loop waits for nobody
                to_systemd.connect(self._address)
                to_systemd.send(text.encode())
        except OSError:
            return  # a flight does not end because nobody listens, or no file can be opened

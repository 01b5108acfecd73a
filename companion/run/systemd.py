"""Reports readiness, status and watchdog keep-alives of a flight to systemd.

The reports are datagrams to systemd's notification socket (sd_notify(3)). The control loop feeds
the watchdog, so systemd kills a process whose loop hangs. The autopilot then stops by its own
setpoint timeout.
"""

import os
import socket
import time
from collections.abc import Callable, Mapping

FEEDS_PER_TIMEOUT = 4
"""Keep-alives per watchdog timeout. Chosen."""
MAP_TIMEOUT_S = 120
"""Watchdog timeout after landing, s.

Chosen: the final smoothing of a long flight takes longer than a tick.
"""


class Service:
    """Connection to systemd; without NOTIFY_SOCKET, nothing is sent."""

    def __init__(
        self,
        environment: Mapping[str, str] = os.environ,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        timeout_s = int(environment.get("WATCHDOG_USEC", 0)) * 1e-6
        self._feed_period_s = timeout_s / FEEDS_PER_TIMEOUT
        self._clock = clock
        self._fed_s = float("-inf")
        self._activity = ""

    def alive(self, activity: str) -> None:
        """Report a tick of the control loop and its activity."""
        now_s = self._clock()
        if activity != self._activity:
            first = "" if self._activity else "READY=1\n"
            self._activity = activity
            self._tell(f"{first}STATUS={activity}\n")
        if self._feed_period_s and now_s - self._fed_s >= self._feed_period_s:
            self._fed_s = now_s
            self._tell("WATCHDOG=1\n")

    def landed(self) -> None:
        """Report the end of the control loop; the map is computed next."""
        self._tell(f"STATUS=saving the map\nWATCHDOG_USEC={MAP_TIMEOUT_S * 1_000_000}\n")

    def _tell(self, text: str) -> None:
        if not self._address:
            return
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as to_systemd:
                to_systemd.setblocking(False)  # the control loop must not block
                to_systemd.connect(self._address)
                to_systemd.send(text.encode())
        except OSError:
            return  # a flight continues without a receiver or a free file descriptor

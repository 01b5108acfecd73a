"""Measures how long drones take to scan a room once, as the paper times it."""

import math

from companion.pdps.room_scan_state import ScanPhase
from companion.ticks import Progress

TURNING, TRACING = ScanPhase.TURN.value, ScanPhase.SCAN.value
"""The companion's activities in the opening turn, and along walls; not in a second round."""


class ScanTime:
    """From the first turn of any drone to the end of the last one's first round."""

    def __init__(self) -> None:
        self._began_s, self._ended_s = math.inf, -math.inf

    def watch(self, progress: Progress) -> None:
        """Note a tick of any drone."""
        if TURNING in progress.activity:
            self._began_s = min(self._began_s, progress.time_s)
        if TRACING in progress.activity:
            self._ended_s = max(self._ended_s, progress.time_s)

    @property
    def seconds(self) -> float | None:
        """The time, s; None if no room was scanned."""
        seconds = self._ended_s - self._began_s
        return round(seconds, 1) if math.isfinite(seconds) else None

"""Derives the time from the autopilot's messages.

The autopilot's simulation may run faster or slower than real time, and with pauses on a busy
machine. Gyro readings and ranges belong to moments of its flight. The world therefore follows its
time, and pauses without messages.
"""

from collections.abc import Callable

from sitl.autopilot.streams import Message

SILENT_S = 1.0
"""Wall time without the autopilot's time before a warning, s. A busy machine may pause the
autopilot for half a second."""
GONE_S = 1.0
"""A difference from which the clocks are aligned anew, s: the autopilot restarted or was away."""


class AutopilotClock:
    """Converts the autopilot's time since boot in ATTITUDE (30) to simulator time from 0."""

    def __init__(self) -> None:
        self._ahead_s: float | None = None
        self._autopilot_s = float("-inf")

    def receive(self, message: Message, now_s: float) -> float | None:
        """Simulator time of a message, s; None if the message has no time."""
        if message.get_type() != "ATTITUDE":
            return None
        boot_s = message.time_boot_ms * 1e-3
        if self._ahead_s is None or abs(boot_s + self._ahead_s - now_s) > GONE_S:
            self._ahead_s = now_s - boot_s
        self._autopilot_s = boot_s + self._ahead_s
        return self._autopilot_s

    def autopilot_s(self, now_s: float) -> float:
        """Time of the last message, s; `now_s` if that is too far off."""
        return self._autopilot_s if now_s - self._autopilot_s <= GONE_S else now_s


class Silence:
    """Reports when the autopilot falls silent and when it returns. Times are wall time, s."""

    def __init__(self, report: Callable[[str], None], began_s: float) -> None:
        self._report = report
        self._received_s = began_s
        self._was_connected = self._is_silent = False

    def receive(self, now_s: float) -> None:
        """Note a message with the autopilot's time."""
        if self._is_silent:
            self._report(f"the autopilot is connected{' again' if self._was_connected else ''}")
        self._received_s, self._was_connected, self._is_silent = now_s, True, False

    def check(self, now_s: float) -> None:
        """Report if the autopilot has been silent for too long."""
        if self._is_silent or now_s - self._received_s <= SILENT_S:
            return
        self._is_silent = True
        state = "is silent" if self._was_connected else "has not sent a message yet"
        self._report(f"the autopilot {state}: the simulation is paused until it sends")

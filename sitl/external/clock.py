"""Time, as the autopilot's own messages tell it.

Its simulation may run faster or slower than real time, and stutter where the machine is busy. What
a gyro measures and how far a beam reaches belong to moments of its flight, so our world follows
its time, and stands still while it is silent.
"""

from collections.abc import Callable

from sitl.autopilot.streams import Message

SILENT_S = 1.0
"""Wall time without its time from which that is told. A busy machine may pause it for half a
second."""
GONE_S = 1.0
"""Farther apart than this the autopilot has been restarted or was away: the two are set again."""


class AutopilotClock:
    """ATTITUDE (30) tells their time since boot; moved to ours, which began at 0."""

    def __init__(self) -> None:
        self._ahead_s: float | None = None
        self._autopilot_s = float("-inf")

    def receive(self, message: Message, now_s: float) -> float | None:
        """Our time of the moment that a message tells of; None if it tells no time."""
        if message.get_type() != "ATTITUDE":
            return None
        boot_s = message.time_boot_ms * 1e-3
        if self._ahead_s is None or abs(boot_s + self._ahead_s - now_s) > GONE_S:
            self._ahead_s = now_s - boot_s
        self._autopilot_s = boot_s + self._ahead_s
        return self._autopilot_s

    def autopilot_s(self, now_s: float) -> float:
        """The moment of what was heard last, as far as the autopilot has told it."""
        return self._autopilot_s if now_s - self._autopilot_s <= GONE_S else now_s


class Silence:
    """Tells when the autopilot falls silent and when it is back; times are wall-clock times."""

    def __init__(self, tell: Callable[[str], None], began_s: float) -> None:
        self._tell = tell
        self._heard_s = began_s
        self._was_heard = self._is_silent = False

    def receive(self, now_s: float) -> None:
        """It has told its time."""
        if self._is_silent:
            self._tell(f"the autopilot is heard{' again' if self._was_heard else ''}")
        self._heard_s, self._was_heard, self._is_silent = now_s, True, False

    def look(self, now_s: float) -> None:
        """Whether it has been silent for too long by now."""
        if self._is_silent or now_s - self._heard_s <= SILENT_S:
            return
        self._is_silent = True
        state = "has fallen silent" if self._was_heard else "has not been heard yet"
        self._tell(f"the autopilot {state}: our world stands still until it is heard")

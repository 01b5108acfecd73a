"""Time, as the autopilot's own messages tell it.

Its simulation may run faster or slower than real time, and stutter where the machine is busy. What
a gyro measures and how far a beam reaches belong to moments of its flight, so our world follows
its time; the wall clock counts only while the autopilot is silent.
"""

from sitl.autopilot.streams import Message

PATIENCE_S = 1.0
"""Wall time of silence for which the autopilot is waited for; then our time goes on without it. A
busy machine may pause it for half a second, in which it does not fly on."""
GONE_S = 1.0
"""Farther apart than this the autopilot has been restarted or was away: the two are set again."""


class AutopilotClock:
    """ATTITUDE (30) tells their time since boot; moved to ours, which began at 0."""

    def __init__(self) -> None:
        self._ahead_s: float | None = None
        self._told_s = float("-inf")

    def hear(self, message: Message, now_s: float) -> float | None:
        """Our time of the moment that a message tells of; None if it tells no time."""
        if message.get_type() != "ATTITUDE":
            return None
        boot_s = message.time_boot_ms * 1e-3
        if self._ahead_s is None or abs(boot_s + self._ahead_s - now_s) > GONE_S:
            self._ahead_s = now_s - boot_s
        self._told_s = boot_s + self._ahead_s
        return self._told_s

    def told_s(self, now_s: float) -> float:
        """The moment of what was heard last, as far as the autopilot has told it."""
        return self._told_s if now_s - self._told_s <= GONE_S else now_s


def patience_s(silent_s: float, wanted_s: float) -> float:
    """How long to wait, by the wall clock, for it to get `wanted_s` further.

    `silent_s`: for how long nothing has been heard of it, by the wall clock, too.
    """
    return max(PATIENCE_S - silent_s, wanted_s)

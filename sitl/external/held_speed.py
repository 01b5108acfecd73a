"""How fast an autopilot elsewhere may run for companion and world to keep up on this machine.

     the companion works      the world works, and waits for the autopilot
    ├────────────────────────┤├──────────────────────────────────────────────┤
    reached               asked                                        reached

What is asked for when its time is over already was late.
"""

from collections.abc import Callable

TICK_S = 0.05
"""The companion's, which the simulator does not load."""
TICKS = 400
"""Of one look, 20 s in real time."""
BUSY_SHARE = 0.95
"""So many of the ticks are done in time at the speed that is told."""
LATE_SHARE = 0.02


class HeldSpeed:
    """Told after the first look, and again whenever ticks are late; times are wall-clock times."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._work_s: list[float] = []
        self._late = 0
        self._began: tuple[float, float] | None = None
        self._has_reported = False

    def asked(self, now_s: float, worked_s: float, time_s: float, wanted_s: float) -> None:
        """After `worked_s` the companion asks for a time; the world is at `time_s`."""
        self._began = self._began or (now_s, time_s)
        self._work_s.append(worked_s)
        self._late += wanted_s < time_s

    def reached(self, now_s: float, stepping_s: float, time_s: float) -> None:
        """The world is there, and worked for `stepping_s` itself on the way."""
        self._work_s[-1] += stepping_s
        if len(self._work_s) < TICKS or self._began is None:
            return
        began_s, from_s = self._began
        self._look((time_s - from_s) / max(now_s - began_s, 1e-9))
        self._work_s.clear()
        self._late, self._began = 0, None

    def _look(self, runs: float) -> None:
        busy_s = sorted(self._work_s)[int(BUSY_SHARE * len(self._work_s)) - 1]
        is_late = self._late > LATE_SHARE * len(self._work_s)
        if self._has_reported and not is_late:
            return
        self._has_reported = True
        held = TICK_S / max(busy_s, 1e-9)
        text = f"the autopilot runs at {runs:.1f} x real time; this machine holds {held:.1f} x"
        if is_late:
            late = 100 * self._late / len(self._work_s)
            text += (
                f": {late:.0f} % of the companion's ticks are late, let the autopilot run slower"
            )
        self._tell(text)

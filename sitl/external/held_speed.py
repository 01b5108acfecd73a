"""Measures the autopilot speed at which companion and world keep up on this machine.

     the companion works      the world works, and waits for the autopilot
    ├────────────────────────┤├──────────────────────────────────────────────┤
    reached               asked                                        reached

A request for a time that has already passed is late.
"""

from collections.abc import Callable

TICK_S = 0.05
"""The companion's tick, s. Repeated here because the simulator does not import the companion's."""
TICKS = 400
"""Ticks in one measurement: 20 s in real time."""
BUSY_SHARE = 0.95
"""Share of the ticks that are in time at the reported speed. Chosen."""
LATE_SHARE = 0.02
"""Share of late ticks from which a warning is given. Chosen."""


class HeldSpeed:
    """Reports after the first measurement, then whenever ticks are late. Times are wall time, s."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._work_s: list[float] = []
        self._late = 0
        self._began: tuple[float, float] | None = None
        self._has_reported = False

    def asked(self, now_s: float, worked_s: float, time_s: float, wanted_s: float) -> None:
        """After `worked_s` the companion requests a time; the world is at `time_s`."""
        self._began = self._began or (now_s, time_s)
        self._work_s.append(worked_s)
        self._late += wanted_s < time_s

    def reached(self, now_s: float, stepping_s: float, time_s: float) -> None:
        """The world has reached `time_s`, with `stepping_s` of its own work."""
        self._work_s[-1] += stepping_s
        if len(self._work_s) < TICKS or self._began is None:
            return
        began_s, from_s = self._began
        self._measure((time_s - from_s) / max(now_s - began_s, 1e-9))
        self._work_s.clear()
        self._late, self._began = 0, None

    def _measure(self, runs: float) -> None:
        busy_s = sorted(self._work_s)[int(BUSY_SHARE * len(self._work_s)) - 1]
        is_late = self._late > LATE_SHARE * len(self._work_s)
        if self._has_reported and not is_late:
            return
        self._has_reported = True
        held = TICK_S / max(busy_s, 1e-9)
        text = f"the autopilot runs at {runs:.1f} x real time; this machine holds {held:.1f} x"
        if is_late:
            late = 100 * self._late / len(self._work_s)
            text += f": {late:.0f} % of the companion's ticks are late, slow the autopilot down"
        self._report(text)

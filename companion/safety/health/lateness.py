"""Detects late ticks of the control loop; between late ticks the drone flies without sensors."""

import math
from collections import deque
from dataclasses import replace

from companion.core.messages import Fault, Setpoint

TICK_S = 0.05
"""Period of the control loop, s."""
LATE_S = 0.1
"""Delay that does not count as late, s. Chosen: saving the map or solving the flight may take as
long on a Raspberry Pi."""
REMEMBERED_S = 2.0
"""Window over which delays are summed, s. Chosen."""
STARVED_S = 0.5
"""Sum of delays in the window from which the drone holds, s. Chosen: the autopilot flies an old
setpoint for as long."""
LASTS_S = 10.0
"""Time for which the drone holds before it lands, s. Chosen: the load on the processor may end."""
RECOVERS_S = 0.3
"""Time after a late tick for which sensors are not checked, s. Chosen: they were not read in
time."""
BLIND_S = 0.5
"""Longest flight on an old setpoint, s; then the autopilot brakes (`link.setpoint_loss_s`)."""


class Lateness:
    """Delays of the ticks in the last `REMEMBERED_S`."""

    def __init__(self) -> None:
        self._last_s: float | None = None
        self._late: deque[tuple[float, float]] = deque()
        """Time and delay of each late tick, s."""
        self.listened_s = 0.0
        """Time since the start without the delays, s; a source cannot be silent during a delay."""

    def tick(self, now_s: float) -> None:
        """Record the start of a tick at `now_s`."""
        step_s = TICK_S if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        self.listened_s += min(step_s, TICK_S + LATE_S)
        if step_s > TICK_S + LATE_S:
            self._late.append((now_s, step_s - TICK_S))
        while self._late and self._late[0][0] < now_s - REMEMBERED_S:
            self._late.popleft()

    @property
    def is_late(self) -> bool:
        """True if this tick or a recent one was late."""
        if self._last_s is None or not self._late:
            return False
        return self._last_s - self._late[-1][0] < RECOVERS_S

    @property
    def worst_s(self) -> float:
        return max((late_s for _, late_s in self._late), default=0.0)

    @property
    def fault(self) -> Fault | None:
        """The fault if the computer has too little time for the flight; else None."""
        if sum(late_s for _, late_s in self._late) < STARVED_S:
            return None
        return Fault(f"the computer is starved: ticks {self.worst_s:.1f} s late", LASTS_S)

    def slowed(self, setpoint: Setpoint | None, clearance_m: float) -> Setpoint | None:
        """Limit the speed so that a flight as long as the worst delay stays in the clearance.

        `clearance_m` is the distance from the hull to obstacles.
        """
        if setpoint is None or not self._late:
            return setpoint
        most_m_s = clearance_m / min(self.worst_s, BLIND_S)
        speed_m_s = math.hypot(setpoint.forward_m_s, setpoint.right_m_s)
        if speed_m_s <= most_m_s:
            return setpoint
        share = most_m_s / speed_m_s
        return replace(
            setpoint,
            forward_m_s=share * setpoint.forward_m_s,
            right_m_s=share * setpoint.right_m_s,
        )

"""Whether the computer keeps up: a control loop that comes round late flies blind meanwhile."""

import math
from collections import deque
from dataclasses import replace

from companion.core.messages import Fault, Setpoint

TICK_S = 0.05
"""So often the control loop comes round."""
LATE_S = 0.1
"""Saving the map or solving the flight anew may take as long on a Raspberry Pi."""
REMEMBERED_S = 2.0
STARVED_S = 0.5
"""Lost to late ticks in that time: the drone holds. An autopilot flies an old setpoint as long."""
LASTS_S = 10.0
"""So long the drone holds, then it lands: whatever took the processor may end."""
RECOVERS_S = 0.3
"""Sensors that were not read in time are not judged before that."""
BLIND_S = 0.5
"""After that the autopilot brakes by itself (`link.setpoint_loss_s`)."""


class Lateness:
    """Of the ticks of the last seconds."""

    def __init__(self) -> None:
        self._last_s: float | None = None
        self._late: deque[tuple[float, float]] = deque()
        """When a tick was late, and by how much."""
        self.listened_s = 0.0
        """All time, but not what was slept through: nobody was silent who was not listened to."""

    def tick(self, now_s: float) -> None:
        """The loop comes round."""
        step_s = TICK_S if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        self.listened_s += min(step_s, TICK_S + LATE_S)
        if step_s > TICK_S + LATE_S:
            self._late.append((now_s, step_s - TICK_S))
        while self._late and self._late[0][0] < now_s - REMEMBERED_S:
            self._late.popleft()

    @property
    def is_late(self) -> bool:
        """This tick, or one just before it."""
        if self._last_s is None or not self._late:
            return False
        return self._last_s - self._late[-1][0] < RECOVERS_S

    @property
    def worst_s(self) -> float:
        return max((late_s for _, late_s in self._late), default=0.0)

    @property
    def fault(self) -> Fault | None:
        """The computer has no time for the flight."""
        if sum(late_s for _, late_s in self._late) < STARVED_S:
            return None
        return Fault(f"the computer is starved: ticks {self.worst_s:.1f} s late", LASTS_S)

    def slowed(self, setpoint: Setpoint | None, clearance_m: float) -> Setpoint | None:
        """So slow that what is flown blind, with a next tick as late, is within the clearance."""
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

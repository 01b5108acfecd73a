"""Monitors failure conditions in flight.

QUIET ──fails──► ACTIVE: text sent; mode changed if the parameters select one
▲                │
└──── cleared ───┘ text sent; the mode stays
"""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.firmware import Condition, Failsafe, ParameterValues
from sitl.autopilot.messages import Broadcast


class FailsafeWatch:
    """The failsafes of one vehicle."""

    def __init__(self, failsafes: tuple[Failsafe, ...]) -> None:
        self._active = dict.fromkeys(failsafes, False)
        self.has_taken_over = False
        """A failsafe that changes the mode is active. HEARTBEAT then reports "critical"."""

    def check(
        self, condition: Condition, parameters: ParameterValues, broadcast: Broadcast
    ) -> int | None:
        """Send texts for changes; return the mode to change to now, if any."""
        wanted = None
        for failsafe, was_active in self._active.items():
            fails = failsafe.fails(condition, parameters) and (condition.flying or was_active)
            self._active[failsafe] = fails
            if fails and not was_active:
                for text in failsafe.texts:
                    broadcast.text(mavlink.MAV_SEVERITY_CRITICAL, text)
                wanted = failsafe.mode(parameters) if wanted is None else wanted
            elif was_active and not fails and failsafe.cleared:
                broadcast.text(mavlink.MAV_SEVERITY_CRITICAL, failsafe.cleared)
        self.has_taken_over = any(
            active and failsafe.mode(parameters) is not None
            for failsafe, active in self._active.items()
        )
        return wanted

"""Reads the state of charge from SYS_STATUS (1), without single wrong reports.

A battery monitor may report 0 % once, for example a smart battery after a lost answer on its bus.
In flight the charge only falls. The largest of the last few reports is therefore never too low.
"""

from collections import deque

from companion.link.transports.transport import Message

REPORTS = 3
"""Number of reports of which the largest counts. Chosen: it bridges two wrong ones, and delays a
true fall by a second at the requested rate."""


class Battery:
    """State of charge of the autopilot's battery."""

    def __init__(self) -> None:
        self._charges: deque[float] = deque(maxlen=REPORTS)
        self._is_known = False

    def receive(self, sys_status: Message) -> None:
        """Note a SYS_STATUS (1)."""
        percent = sys_status.battery_remaining
        self._is_known = 0 <= percent <= 100  # -1: unknown
        if self._is_known:
            self._charges.append(percent / 100)

    @property
    def charge(self) -> float | None:
        """Share of the capacity that is left, 0 to 1; None if it is not reported."""
        return max(self._charges) if self._is_known else None

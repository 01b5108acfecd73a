"""Schedules the messages of one link at their requested intervals, on the 10 ms grid."""

from collections.abc import Callable
from typing import Any

Message = Any
Maker = Callable[[], list[Message]]
"""Returns the messages for this moment; an empty list if there are none."""

MAX_INTERVAL_US = 2**31 - 1
"""Largest message interval, µs: MESSAGE_INTERVAL (244) has an int32."""
STEPS_PER_S = 100
"""Scheduling steps per second: the 10 ms grid."""
PHASE_STEPS = 7
"""Phase shift per message id, steps. Like a real autopilot, messages of one rate are spread."""


class Streams:
    """Message intervals of one link."""

    def __init__(self, makers: dict[int, Maker], default_hz: dict[int, float]) -> None:
        self._makers = makers
        self._default_hz = default_hz
        self._every: dict[int, int] = {}
        self._timetable: list[tuple[int, int, Maker]] = []
        """Requested messages: period in steps, phase, maker."""
        self.restart()

    def restart(self) -> None:
        """Reset to the streams that need no request."""
        self._every.clear()
        self._timetable.clear()
        for message_id, rate_hz in self._default_hz.items():
            self.set_interval(message_id, 1e6 / rate_hz)

    def supports(self, message_id: int) -> bool:
        return message_id in self._makers

    def set_interval(self, message_id: int, interval_us: float) -> bool:
        """Set an interval; False if there is no such message or the interval is invalid."""
        if not self.supports(message_id) or not interval_us <= MAX_INTERVAL_US:  # false for NaN too
            return False
        if interval_us <= 0:
            self._every.pop(message_id, None)
        else:
            self._every[message_id] = max(1, round(interval_us * STEPS_PER_S / 1e6))
        self._timetable = [
            (every, -PHASE_STEPS * message_id % every, self._makers[message_id])
            for message_id, every in self._every.items()
        ]
        return True

    def interval_us(self, message_id: int) -> int:
        """Response to MAV_CMD_GET_MESSAGE_INTERVAL (510), µs; 0: not available, -1: off."""
        if not self.supports(message_id):
            return 0
        every = self._every.get(message_id)
        return -1 if every is None else every * 1_000_000 // STEPS_PER_S

    def make(self, message_id: int) -> list[Message]:
        """Response to MAV_CMD_REQUEST_MESSAGE (512); empty if not available."""
        maker = self._makers.get(message_id)
        return maker() if maker else []

    def due(self, step: int) -> list[Message]:
        """Messages that this step sends."""
        messages: list[Message] = []
        for every, phase, make in self._timetable:
            if step % every == phase:
                messages += make()
        return messages

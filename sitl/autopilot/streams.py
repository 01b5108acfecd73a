"""Which messages go out when on one link: those asked for, on the 10 ms grid."""

from collections.abc import Callable
from typing import Any

Message = Any
Maker = Callable[[], list[Message]]
"""Makes the messages of this moment; none while there is nothing to say."""

MAX_INTERVAL_US = 2**31 - 1
STEPS_PER_S = 100
PHASE_STEPS = 7
"""Messages of one rate are not all sent in the same step: a real one sends them as time allows."""


class Streams:
    """Message intervals of one link."""

    def __init__(self, makers: dict[int, Maker], unasked_hz: dict[int, float]) -> None:
        self._makers = makers
        self._unasked_hz = unasked_hz
        self._every: dict[int, int] = {}
        self._timetable: list[tuple[int, int, Maker]] = []
        """Of what is asked for: every how many steps, at which of them, and how it is made."""
        self.restart()

    def restart(self) -> None:
        """Only what nobody has asked for."""
        self._every.clear()
        self._timetable.clear()
        for message_id, rate_hz in self._unasked_hz.items():
            self.set_interval(message_id, 1e6 / rate_hz)

    def knows(self, message_id: int) -> bool:
        return message_id in self._makers

    def set_interval(self, message_id: int, interval_us: float) -> bool:
        """Whether there is such a message, and it can be sent so."""
        if not self.knows(message_id) or not interval_us <= MAX_INTERVAL_US:  # false for NaN too
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
        """What MAV_CMD_GET_MESSAGE_INTERVAL (510) answers; 0: not available, -1: off."""
        if not self.knows(message_id):
            return 0
        every = self._every.get(message_id)
        return -1 if every is None else every * 1_000_000 // STEPS_PER_S

    def make(self, message_id: int) -> list[Message]:
        """MAV_CMD_REQUEST_MESSAGE (512): of this moment, if there is such a one."""
        maker = self._makers.get(message_id)
        return maker() if maker else []

    def due(self, step: int) -> list[Message]:
        """What this step sends."""
        messages: list[Message] = []
        for every, phase, make in self._timetable:
            if step % every == phase:
                messages += make()
        return messages

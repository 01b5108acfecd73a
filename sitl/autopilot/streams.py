"""Which messages go out when: those asked for with SET_MESSAGE_INTERVAL, on the 10 ms grid."""

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

Message = Any
Maker = Callable[[], Message | None]
"""Makes a message of this moment; None while there is nothing to say."""

ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
DENIED: int = mavlink.MAV_RESULT_DENIED
LEAST_INTERVAL_US = 2000
STEPS_PER_S = 100


class Streams:
    """Message intervals."""

    def __init__(self, makers: dict[int, Maker], unasked_hz: dict[int, float]) -> None:
        self._makers = makers
        self._every: dict[int, int] = {}
        for message_id, rate_hz in unasked_hz.items():
            self.set_interval(message_id, 1e6 / rate_hz)

    def set_interval(self, message_id: int, interval_us: float) -> int:
        """MAV_CMD_SET_MESSAGE_INTERVAL (511); its MAV_RESULT."""
        if message_id not in self._makers or not math.isfinite(interval_us):
            return DENIED
        if 0 < interval_us < LEAST_INTERVAL_US:
            return DENIED
        if interval_us <= 0:
            self._every.pop(message_id, None)
        else:
            self._every[message_id] = max(1, round(interval_us * STEPS_PER_S / 1e6))
        return ACCEPTED

    def interval_us(self, message_id: int) -> int:
        """What MAV_CMD_GET_MESSAGE_INTERVAL (510) answers; 0: not available, -1: off."""
        if message_id not in self._makers:
            return 0
        every = self._every.get(message_id)
        return -1 if every is None else every * 1_000_000 // STEPS_PER_S

    def make(self, message_id: int) -> Message | None:
        """MAV_CMD_REQUEST_MESSAGE (512): one message now, if there is such a one."""
        maker = self._makers.get(message_id)
        return maker() if maker else None

    def due(self, step: int) -> list[Message]:
        """What this step sends."""
        messages = [self._makers[m]() for m, every in self._every.items() if step % every == 0]
        return [message for message in messages if message is not None]

"""Reads the autopilot's parameters that checks need, whichever firmware it has."""

import math
from collections.abc import Iterable, Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.firmware import Firmware
from companion.link.parameters import read_requests
from companion.link.transports.transport import Message

REQUEST_PERIOD_S = 1.0
"""Interval of the requests, s. Chosen."""


class AskedParameters:
    """Requests parameters until each is received; a `Listener`."""

    def __init__(self, system_id: int) -> None:
        self.streams_hz = {int(mavlink.MAVLINK_MSG_ID_PARAM_VALUE): 0.0}
        self._target = system_id, int(mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._messages: dict[str, Message] = {}
        self._requested_s = -math.inf

    def receive(self, message: Message, now_s: float) -> None:
        self._messages[message.param_id] = message

    def values(self, firmware: Firmware) -> Mapping[str, float]:
        """All received values by name."""
        received = self._messages.items()
        return {name: firmware.parameter_value(message) for name, message in received}

    def requests(self, now_s: float, names: Iterable[str]) -> list[Message]:
        """PARAM_REQUEST_READ (20) for each missing parameter, if they are due."""
        if now_s - self._requested_s < REQUEST_PERIOD_S:
            return []
        self._requested_s = now_s
        return read_requests(self._target, (name for name in names if name not in self._messages))

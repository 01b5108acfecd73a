"""The parameter protocol, over a table of names with defaults and types."""

import math
import struct

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.personality import Personality
from sitl.autopilot.streams import Message

ASKED_BY_NAME = 65535
"""param_index of an answer that is not part of a list."""
_FORMATS = {
    mavlink.MAV_PARAM_TYPE_INT8: "<b3x",
    mavlink.MAV_PARAM_TYPE_INT16: "<h2x",
    mavlink.MAV_PARAM_TYPE_INT32: "<i",
}


class Parameters:
    """Values by name. A wrong type is accepted, an unknown name met with silence."""

    def __init__(self, personality: Personality) -> None:
        self._types = {name: kind for name, (_, kind) in personality.parameters.items()}
        self._bytewise = personality.has_bytewise_parameters
        self.values = {name: float(value) for name, (value, _) in personality.parameters.items()}

    def set(self, message: Message) -> list[Message]:
        """PARAM_SET (23); the answer."""
        name = message.param_id
        if name not in self.values:
            return []
        value = self._decoded(message.param_value, message.param_type)
        if math.isfinite(value):
            self.values[name] = value
        return [self._told(name, ASKED_BY_NAME)]

    def read(self, message: Message) -> list[Message]:
        """PARAM_REQUEST_READ (20), by index or, if that is -1, by name."""
        names = list(self.values)
        if 0 <= message.param_index < len(names):
            return [self._told(names[message.param_index], message.param_index)]
        if message.param_index == -1 and message.param_id in self.values:
            return [self._told(message.param_id, ASKED_BY_NAME)]
        return []

    def list(self) -> list[Message]:
        """PARAM_REQUEST_LIST (21)."""
        return [self._told(name, index) for index, name in enumerate(self.values)]

    def _told(self, name: str, index: int) -> Message:
        kind = self._types[name]
        value = self._encoded(self.values[name], kind)
        return mavlink.MAVLink_param_value_message(
            name.encode(), value, kind, len(self.values), index
        )

    def _encoded(self, value: float, kind: int) -> float:
        if not self._bytewise or kind not in _FORMATS:
            return value
        (as_float,) = struct.unpack("<f", struct.pack(_FORMATS[kind], int(value)))
        return float(as_float)

    def _decoded(self, value: float, kind: int) -> float:
        if not self._bytewise or kind not in _FORMATS:
            return value
        (as_int,) = struct.unpack(_FORMATS[kind], struct.pack("<f", value))
        return float(as_int)

"""PX4's parameter protocol: integers travel as bytes, and only the true type is accepted."""

import math
import struct
import zlib
from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.parameters.protocol import NO_INDEX, Parameters
from sitl.autopilot.parameters.table import Parameter
from sitl.autopilot.streams import Message

HASH = "_HASH_CHECK"
"""Read like a parameter: a ground station compares this hash with that of its cached values."""
ALL_BITS = 0xFFFFFFFF
"""All bits of a CRC-32: cancel the inversion of `zlib.crc32`."""


class Px4Parameters(Parameters):
    """Protocol as in mavlink_parameters.cpp of PX4 1.17."""

    listed_per_step = 20
    """Parameters per 10 ms over UDP (PX4's source)."""

    def set(self, message: Message) -> list[Message]:
        """PARAM_SET (23). Setting the hash means that the ground station needs no list."""
        if message.param_id == HASH:
            if self.values["MAV_HASH_CHK_EN"]:
                self._to_list.clear()
            return []
        return super().set(message)

    def read(self, message: Message) -> list[Message]:
        """PARAM_REQUEST_READ (20), also of the hash."""
        if message.param_index == -1 and message.param_id == HASH:
            return [self._value_message(HASH, NO_INDEX)]
        return super().read(message)

    def begin_list(self) -> None:
        """PARAM_REQUEST_LIST (21): the hash is sent first, unless a running list is restarted."""
        first = [] if self._to_list else [HASH]
        self._to_list = deque([*first, *self._table])

    def _value_message(self, name: str, index: int) -> Message:
        if name != HASH:
            return super()._value_message(name, index)
        kind = mavlink.MAV_PARAM_TYPE_UINT32
        return mavlink.MAVLink_param_value_message(
            HASH.encode(), _as_float(struct.pack("<I", self._hash())), kind, len(self._table), index
        )

    def _taken(self, parameter: Parameter, message: Message) -> float | None:
        """The new value; None for a wrong type, which has no response."""
        if message.param_type != parameter.kind:
            return None
        value: float = message.param_value
        if parameter.kind == mavlink.MAV_PARAM_TYPE_INT32:
            (value,) = struct.unpack("<i", struct.pack("<f", value))
            return float(value)
        # PX4 would also store values that are not finite, but that vehicle could not fly
        return value if math.isfinite(value) else None

    def _wire(self, value: float, kind: int) -> float:
        return _as_float(_four_bytes(value, kind))

    def _answer(self, name: str) -> Message:
        return self._value_message(name, self._index[name])

    def _hash(self) -> int:
        """`param_hash_check`: a CRC-32, not inverted, over each name and its value's bytes."""
        data = b"".join(
            name.encode() + _four_bytes(self.values[name], parameter.kind)
            for name, parameter in self._table.items()
        )
        return zlib.crc32(data, ALL_BITS) ^ ALL_BITS


def _four_bytes(value: float, kind: int) -> bytes:
    if kind == mavlink.MAV_PARAM_TYPE_INT32:
        return struct.pack("<i", int(value))
    return struct.pack("<f", value)


def _as_float(data: bytes) -> float:
    (value,) = struct.unpack("<f", data)
    return float(value)

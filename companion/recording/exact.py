"""Encodes ticks and maps as bytes without loss: floats keep their 64 bits, also NaN and infinity.

The format is MessagePack with field names. Recordings are readable without this program, and fields
with a default may be added later.
"""

from msgspec import msgpack

from companion.core.messages import FloorPlan
from companion.core.values import value
from companion.ticks import Inputs


@value
class Tick:
    """Arguments of `App.step`."""

    now_s: float
    inputs: Inputs


def _plain(number: object) -> float:
    """Convert a numpy float to a Python float."""
    if isinstance(number, float):
        return float(number)
    raise TypeError(f"{type(number).__name__} is not recorded")


_encoder = msgpack.Encoder(enc_hook=_plain)
_ticks_decoder = msgpack.Decoder(list[Tick])
_plan_decoder = msgpack.Decoder(FloorPlan)


def encode_ticks(ticks: list[Tick]) -> bytes:
    return _encoder.encode(ticks)


def decode_ticks(data: bytes) -> list[Tick]:
    return _ticks_decoder.decode(data)


def encode_plan(plan: FloorPlan) -> bytes:
    """Equal bytes mean identical maps."""
    return _encoder.encode(plan)


def decode_plan(data: bytes) -> FloorPlan:
    return _plan_decoder.decode(data)

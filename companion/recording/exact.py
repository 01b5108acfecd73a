"""Ticks and maps as bytes, exactly: every float keeps its 64 bits, NaN and infinity too.

MessagePack with the names of the fields, so that a recording can be read without this program, and
so that fields with a default may be added to the values later.
"""

from msgspec import msgpack

from companion.app import Inputs
from companion.core.messages import FloorPlan
from companion.core.values import value


@value
class Tick:
    """What `App.step` was called with."""

    now_s: float
    inputs: Inputs


def _plain(number: object) -> float:
    """A numpy float as the float that it is."""
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
    """Equal bytes are equal maps, to the bit."""
    return _encoder.encode(plan)


def decode_plan(data: bytes) -> FloorPlan:
    return _plan_decoder.decode(data)

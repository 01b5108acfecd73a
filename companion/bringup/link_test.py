"""Detects faults of the link's traffic: dropped messages and slow streams."""

from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.requests import Stream
from companion.link.transports.serial_transport import SerialTransport
from companion.link.transports.transport import Transport

MAX_DROPPED = 0.05
"""Largest share of dropped messages. Chosen: a dropped message now and then is normal."""
SLOW_REMEDY = (
    "requested repeatedly: disable the stream rates of the ground station on this link "
    "(Mission Planner: rates -1, MAVProxy: set streamrate -1), or raise the baud rate"
)
"""Remedy for streams below their requested rate."""


def dropped_messages(transport: Transport) -> tuple[str, str] | None:
    """Symptom and remedy of dropped messages; None if the port accepts them."""
    if not isinstance(transport, SerialTransport):
        return None
    dropped = transport.messages_dropped
    tried = dropped + transport.messages_sent
    if dropped <= MAX_DROPPED * tried:
        return None
    remedy = (
        "the port accepts no data, or is too slow: disable its flow control (BRD_SERn_RTSCTS = 0, "
        "no ctsrts in config.txt), raise the baud rate, or reconnect a USB autopilot"
    )
    return f"{dropped} of {tried} messages were dropped", remedy


def slow_streams(streams: Sequence[Stream]) -> tuple[str, str] | None:
    """Symptom and remedy of streams below their requested rate."""
    slow = [
        f"{_name(stream)} {stream.measured_hz:.0f} Hz of {stream.rate_hz:g}"
        for stream in streams
        if stream.is_slow
    ]
    if not slow:
        return None
    return ", ".join(slow), SLOW_REMEDY


def stream_rates(streams: Sequence[Stream]) -> str:
    """Measured rate of every requested stream, as text."""
    return ", ".join(f"{_name(s)} {s.measured_hz:.0f} Hz" for s in streams if s.measured_hz)


def unsteady_streams(streams: Sequence[Stream]) -> str:
    """Streams without a measured rate, because they are new or were interrupted; as text."""
    return ", ".join(_name(stream) for stream in streams if stream.measured_hz is None)


def _name(stream: Stream) -> str:
    return str(mavlink.mavlink_map[stream.message_id].msgname)

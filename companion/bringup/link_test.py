"""Detects faults of the link's traffic: dropped messages and slow streams."""

from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.requests import Stream
from companion.link.transports.serial_transport import SerialTransport
from companion.link.transports.transport import Transport

MAX_DROPPED = 0.05
"""Largest share of dropped messages. Chosen: a dropped message now and then is normal."""


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
        f"{mavlink.mavlink_map[stream.message_id].msgname} {stream.measured_hz:.0f} Hz "
        f"of {stream.rate_hz:g}"
        for stream in streams
        if stream.is_slow
    ]
    if not slow:
        return None
    remedy = (
        "requested repeatedly: disable the stream rates of the ground station on this link "
        "(Mission Planner: rates -1, MAVProxy: set streamrate -1), or raise the baud rate"
    )
    return ", ".join(slow), remedy

"""What is wrong with the traffic on the link: what is not taken, and what comes too seldom."""

from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.requests import Stream
from companion.link.transports.serial_transport import SerialTransport
from companion.link.transports.transport import Transport

MAX_DROPPED = 0.05
"""Of what is sent; a little more than a message now and then."""


def not_taken(transport: Transport) -> tuple[str, str] | None:
    """Seen, and what to do; None if the port takes what is sent."""
    if not isinstance(transport, SerialTransport):
        return None
    dropped = transport.messages_dropped
    tried = dropped + transport.messages_sent
    if dropped <= MAX_DROPPED * tried:
        return None
    remedy = (
        "the port takes nothing, or is too slow: switch its flow control off (BRD_SERn_RTSCTS = 0, "
        "no ctsrts in config.txt), raise the baud rate, or plug a USB autopilot in again"
    )
    return f"{dropped} of {tried} messages were not taken", remedy


def slow_streams(streams: Sequence[Stream]) -> tuple[str, str] | None:
    """The same, of what the autopilot was asked for."""
    slow = [
        f"{mavlink.mavlink_map[stream.message_id].msgname} {stream.measured_hz:.0f} Hz "
        f"of {stream.rate_hz:g}"
        for stream in streams
        if stream.is_slow
    ]
    if not slow:
        return None
    remedy = (
        "asked for again and again: switch off the stream rates of the ground station on this link "
        "(Mission Planner: rates -1, MAVProxy: set streamrate -1), or raise the baud rate"
    )
    return ", ".join(slow), remedy

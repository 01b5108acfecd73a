"""Checks that the sent messages and the requested streams fit the baud rate of the link.

The sent bytes are measured: the link and the reports run for 5 s against a stub of an autopilot.
The requested bytes are the sum over the streams of rate times message size. Both directions have
the same capacity: a tenth of the baud rate, in bytes per second.
"""

from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.range_sensors import AutopilotRange
from companion.config.settings import Config
from companion.core.errors import ConfigError
from companion.core.messages import Beam, Pose, RangeReading, RangeScan, RangeState, Setpoint
from companion.core.values import value
from companion.drivers.autopilot import AutopilotRanges
from companion.drivers.autopilot_gyro import AutopilotGyro
from companion.drivers.models import range_models
from companion.link.link import Link, Listener
from companion.link.reports import Reports
from companion.link.transports.serial_line import BITS_PER_BYTE
from companion.link.transports.transport import Message, make_codec

TICK_S = 0.05
"""Period of the control loop in the trial, s."""
SETTLED_S, END_S = 1.0, 5.0
"""Start and end of the measured part of the trial, s.

Chosen: messages that are sent only at the start are not counted.
"""
REQUESTS = ("COMMAND_LONG", "PARAM_REQUEST_READ", "PARAM_SET", "SET_GPS_GLOBAL_ORIGIN")
"""Messages that are repeated only until they take effect, which is before the flight."""
USUAL_BAUDS = (57600, 115200, 230400, 460800, 921600, 1500000)
"""Baud rates that an error message recommends."""
FRAME_BYTES = mavlink.HEADER_LEN_V2 + 2
"""Header and checksum of a MAVLink 2 frame, bytes."""


@value
class Budget:
    """Load of both directions of a link, bytes per second."""

    sent: Mapping[str, float]
    """By message name."""
    asked_for: Mapping[str, float]

    @property
    def most(self) -> float:
        """Load of the busier direction, bytes per second."""
        return max(sum(self.sent.values()), sum(self.asked_for.values()))


class _StubTransport:
    """Stub transport: counts sent bytes, and replies as an autopilot with a valid position."""

    def __init__(self, config: Config) -> None:
        self._codec = make_codec(config.link.system_id, config.link.component_id)
        self._autopilot = make_codec(config.link.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._signature_bytes = _signature_bytes(config)
        self.now_s = 0.0
        self.sent: dict[str, float] = {}

    def receive(self) -> list[Message]:
        ms = round(1000 * self.now_s) + 1
        out = (
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 81, 4, 4, 3
            ),
            mavlink.MAVLink_attitude_message(ms, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_local_position_ned_message(ms, 0, 0, 0, 0, 0, 0),
        )
        return self._autopilot.parse_buffer(b"".join(m.pack(self._autopilot) for m in out)) or []

    def send(self, message: Message) -> None:
        kind = message.get_type()
        if self.now_s < SETTLED_S or kind in REQUESTS:
            return
        size = len(message.pack(self._codec)) + self._signature_bytes
        self.sent[kind] = self.sent.get(kind, 0.0) + size / (END_S - SETTLED_S)

    def close(self) -> None:
        """No resource to release."""


def link_budget(config: Config) -> Budget:
    """Load of the link during a scan."""
    stub = _StubTransport(config)
    own = {b: s for b, s in config.sensors.beams.items() if isinstance(s, AutopilotRange)}
    listeners: list[Listener] = [AutopilotRanges(own)] if own else []
    if config.sensors.gyro == "autopilot":
        listeners.append(AutopilotGyro())
    link = Link(stub, config.link, listeners)
    models = range_models(config.sensors)
    reports = Reports(config.link, models)
    for tick in range(round(END_S / TICK_S)):
        stub.now_s = now_s = tick * TICK_S
        scan = RangeScan(now_s, {beam: _reading() for beam in models})
        link.poll(now_s)
        link.send(now_s, Setpoint(1.0, 1.0, 1.0, 1.0), None, Pose(now_s, 1.0, 1.0, -1.0, 1.0))
        link.transmit(reports.due(now_s, scan, "", ""))
    return Budget(stub.sent, dict(_asked_for(link, own, _signature_bytes(config))))


def require_capacity(config: Config) -> None:
    """Reject a configuration that exceeds the link's capacity, before anything is opened.

    Raises:
        ConfigError: the load exceeds the capacity; names the keys, their values and the remedies.
    """
    if complaint := budget_error(config):
        raise ConfigError(complaint)


def budget_error(config: Config) -> str:
    """Reason why a serial link is too slow, with the remedies; empty if it is fast enough."""
    if not config.link.url.startswith("serial:"):
        return ""
    baud = int(config.link.url.rsplit(":", 1)[1])
    capacity, budget = baud / BITS_PER_BYTE, link_budget(config)
    remedies = (
        [f"raise the baud rate to {_baud_for(budget.most)}"] if _baud_for(budget.most) else []
    )
    if (sent := sum(budget.sent.values())) > capacity:
        settings, more = _extras(config)
        remedies += more
        needs = f"{settings} needs {sent:.0f} B/s of {capacity:.0f} ({_listed(budget.sent)})"
    elif (asked_for := sum(budget.asked_for.values())) > capacity:
        needs = (
            f" asks the autopilot for {asked_for:.0f} B/s of {capacity:.0f} "
            f"({_listed(budget.asked_for)})"
        )
    else:
        return ""
    return f"link.url = {config.link.url}{needs}: {', or '.join(remedies)}"


def _extras(config: Config) -> tuple[str, list[str]]:
    """Settings that add messages which flight does not need, and how to switch them off."""
    link = config.link
    settings, remedies = [], []
    if link.send_pose:
        settings.append("link.send_pose = true")
        remedies.append("set link.send_pose = false")
    if link.tell_ranges != "none":
        settings.append(f'link.tell_ranges = "{link.tell_ranges}"')
        remedies.append('set link.tell_ranges = "none"')
    return (f" with {' and '.join(settings)}" if settings else ""), remedies


def _asked_for(
    link: Link, own: Mapping[Beam, AutopilotRange], signature_bytes: int
) -> list[tuple[str, float]]:
    asked = []
    for stream in link.streams:
        kind = mavlink.mavlink_map[stream.message_id]
        times = len(own) if stream.message_id == mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR else 1
        size = kind.unpacker.size + FRAME_BYTES + signature_bytes
        asked.append((kind.msgname, stream.rate_hz * size * times))
    return asked


def _signature_bytes(config: Config) -> int:
    return mavlink.MAVLINK_SIGNATURE_BLOCK_LEN if config.link.signing_key is not None else 0


def _reading() -> RangeReading:
    return RangeReading(RangeState.DISTANCE, 1.0, 1e-3)


def _baud_for(bytes_per_s: float) -> int | None:
    fitting = (baud for baud in USUAL_BAUDS if baud / BITS_PER_BYTE >= bytes_per_s)
    return next(fitting, None)


def _listed(by_message: Mapping[str, float]) -> str:
    most_first = sorted(by_message.items(), key=lambda item: -item[1])
    return ", ".join(f"{kind} {rate:.0f}" for kind, rate in most_first)

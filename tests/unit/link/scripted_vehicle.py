"""A scripted autopilot for tests of the link, and the messages that it sends."""

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.core.messages import Command, Setpoint
from companion.link.link import Link, Telemetry
from companion.link.transports.transport import Message, pipe_pair
from tests.unit.sitl.autopilot.client import as_float

TICK_S = 0.05


class Vehicle:
    """An autopilot that sends the messages of the test and stores those it receives."""

    def __init__(self, config: LinkConfig | None = None, *, needs_pilot: bool = False) -> None:
        self.transport, companion = pipe_pair()
        self.link = Link(companion, config or LinkConfig(), needs_pilot=needs_pilot)
        self.now_s = 0.0
        self.received: list[Message] = []
        self.received_at: list[tuple[float, Message]] = []

    def sends(self, *messages: Message) -> Telemetry:
        for message in messages:
            self.transport.send(message)
        return self.link.poll(self.now_s)

    def tick(self, setpoint: Setpoint | None = None, command: Command | None = None) -> list[Any]:
        self.link.send(self.now_s, setpoint, command)
        new: list[Any] = self.transport.receive()
        self.received += new
        self.received_at += [(self.now_s, message) for message in new]
        self.now_s += TICK_S
        return new


def heartbeat(mode: int = 0, *, armed: bool = False) -> Message:
    base = 81 | (128 if armed else 0)
    return mavlink.MAVLink_heartbeat_message(2, 3, base, mode, 3, 3)


def position(ms: int, north: float = 0.0) -> Message:
    return mavlink.MAVLink_local_position_ned_message(ms, north, 2, -1, 0.1, 0.2, 0.3)


def attitude(ms: int, yaw: float = 0.5) -> Message:
    return mavlink.MAVLink_attitude_message(ms, 0, 0, yaw, 0, 0, 0.2)


def landed_state(value: int) -> Message:
    return mavlink.MAVLink_extended_sys_state_message(0, value)


def ticks_for(vehicle: Vehicle, seconds: float) -> list[Any]:
    return [m for _ in range(round(seconds / TICK_S)) for m in vehicle.tick()]


def px4_heartbeat() -> Message:
    return mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, 81, 0, 3, 3)


def px4_parameter(name: bytes, value: int) -> Message:
    return mavlink.MAVLink_param_value_message(name, as_float("<i", value), 6, 1, 0)

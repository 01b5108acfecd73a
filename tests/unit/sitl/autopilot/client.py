"""A ground station for the conformance tests of the emulated autopilots."""

import math
import struct
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transports.transport import Message, pipe_pair
from sitl.autopilot.core import Autopilot
from sitl.core.truth import TrueState

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
ORIGIN = mavlink.MAVLink_set_gps_global_origin_message(1, 473977000, 85456000, 488000)
START = TrueState(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.3, 0.0)


class Client:
    """A ground station connected to the vehicle by a pipe of bytes."""

    def __init__(self, firmware: str = "ardupilot", seed: int = 1, **options: Any) -> None:
        self.autopilot = Autopilot(seed, START, firmware=firmware, **options)
        self._vehicle_end, self._end = pipe_pair()

    def sends(self, message: Message) -> list[Any]:
        self._end.send(message)
        for received in self._vehicle_end.receive():
            self.autopilot.receive(received)
        return self._received()

    def waits(self, seconds: float) -> list[Any]:
        for _ in range(round(seconds * 100)):
            self.autopilot.step()
        return self._received()

    def _received(self) -> list[Any]:
        for message in self.autopilot.take_outbox():
            self._vehicle_end.send(message)
        return self._end.receive()

    def commands(self, command: int, *parameters: float) -> list[Any]:
        padded = (*parameters, *(0.0,) * (7 - len(parameters)))
        return self.sends(mavlink.MAVLink_command_long_message(1, 1, command, 0, *padded))

    def result(self, command: int, *parameters: float) -> int:
        """Result of the last acknowledgement; PX4 acknowledges a mode twice."""
        acks = [m for m in self.commands(command, *parameters) if m.get_type() == "COMMAND_ACK"]
        assert {m.command for m in acks} == {command}
        result: int = acks[-1].result
        return result

    def receives_texts(self) -> "Client":
        """Send a ground station's HEARTBEAT: PX4 sends texts to nobody else."""
        self.sends(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0, 3))
        return self

    def sets(self, name: str, value: float, kind: int = mavlink.MAV_PARAM_TYPE_REAL32) -> list[Any]:
        message = mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, kind)
        return [m for m in self.sends(message) if m.get_type() == "PARAM_VALUE"]

    def reads(self, name: str = "", index: int = -1) -> list[Any]:
        return self.sends(mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), index))

    def lists(self) -> None:
        assert self.sends(mavlink.MAVLink_param_request_list_message(1, 1)) == []

    def is_ready(self) -> "Client":
        self.waits(5)
        self.sends(ORIGIN)
        assert self.result(176, 1, 4) == ACCEPTED
        return self

    def flies(self) -> "Client":
        self.is_ready()
        assert self.result(400, 1) == ACCEPTED
        assert self.result(22, 0, 0, 0, 0, 0, 0, 2) == ACCEPTED
        self.waits(8)
        return self

    def velocity(
        self, *, frame: int, mask: int, vx: float = 1.0, vz: float = 0.0, yaw_rate: float = 0.0
    ) -> list[Any]:
        return self.sends(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, frame, mask, 0, 0, 0, vx, 0, vz, 0, 0, 0, 0, yaw_rate
            )
        )

    def speed(self) -> float:
        return math.hypot(*self.autopilot.truth.velocity_ned_m_s[:2])


def kinds(messages: list[Any]) -> list[str]:
    return [m.get_type() for m in messages]


def as_float(code: str, value: int) -> float:
    """A number's bytes as a float, the encoding of PX4's integers."""
    (number,) = struct.unpack("<f", struct.pack(code, value))
    return float(number)

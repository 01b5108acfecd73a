"""Configures an external autopilot for flight in the simulated world.

WAITING ──HEARTBEAT──► ASKING: streams, each parameter ──all as wanted──► READY
                         ▲ │
                         └─┘ once a second

The companion sets the origin of the autopilot's position; here it is only checked.
"""

import math
import struct
from collections.abc import Callable, Mapping
from importlib import resources

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.requests import command_long
from sitl.autopilot.estimation.ground_truth import Place, offset_ned_m
from sitl.autopilot.parameters.file import ParameterFile
from sitl.autopilot.parameters.table import load_table
from sitl.autopilot.streams import Message

AUTOPILOTS = {
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: "ardupilot",
    mavlink.MAV_AUTOPILOT_PX4: "px4",
}
TRUTH_MESSAGE = {
    "ardupilot": mavlink.MAVLINK_MSG_ID_SIM_STATE,
    "px4": mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION,
}
TRUTH_HZ = ATTITUDE_HZ = 50.0
"""Requested message rates, Hz."""
ASK_PERIOD_S = 1.0
"""Period of the requests, s."""
MAX_ORIGIN_OFF_M = 50_000.0
"""Largest distance of origin and simulated location, m. Within it the magnetic declination differs
by less than a degree, except near the poles."""
NEEDS_RESTART = (
    "EKF2_HGT_REF",
    "GPS1_TYPE",
    "PRX1_TYPE",
    "RNGFND1_TYPE",
    "SYS_HAS_GPS",
    "VISO_TYPE",
)
"""Parameters that real autopilots read only at their start."""


def wanted_parameters(firmware: str) -> dict[str, float]:
    """Required parameters, from the file that comes with the simulator."""
    with resources.as_file(resources.files("sitl.external") / f"{firmware}.parm") as path:
        return ParameterFile(path, load_table(firmware)).values


class ExternalSetup:
    """Sends requests until the autopilot is configured. Time is an argument."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._target: tuple[int, int] | None = None
        self._firmware = ""
        self._home: Place | None = None
        self._missing: Mapping[str, float] = {}
        self._changed: list[str] = []
        self._origin: Place | None = None
        self._truth_s = self._attitude_s = self._asked_s = float("-inf")
        self._is_ready = False

    @property
    def firmware(self) -> str:
        """Its firmware in `AUTOPILOTS`; empty before its first HEARTBEAT."""
        return self._firmware

    @property
    def target(self) -> tuple[int, int] | None:
        """System and component of the autopilot; None before its first HEARTBEAT."""
        return self._target

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message from the autopilot."""
        match message.get_type():
            case "HEARTBEAT" if self._target is None and message.autopilot in AUTOPILOTS:
                self._target = message.get_srcSystem(), message.get_srcComponent()
                self._firmware = AUTOPILOTS[message.autopilot]
                self._missing = wanted_parameters(self._firmware)
                self._report(f"autopilot {self._firmware}, system {self._target[0]}")
            case "GPS_GLOBAL_ORIGIN":
                self._note_origin((message.latitude, message.longitude, message.altitude))
            case "PARAM_VALUE":
                self._check(message)
            case "SIM_STATE" | "HIL_STATE_QUATERNION":
                self._truth_s = now_s
            case "ATTITUDE":
                self._attitude_s = now_s

    def _check(self, message: Message) -> None:
        wanted = self._missing.get(message.param_id)
        if wanted is None:
            return
        if math.isclose(self._decoded(message), wanted, rel_tol=1e-6, abs_tol=1e-9):
            self._missing = {n: v for n, v in self._missing.items() if n != message.param_id}
        elif message.param_id not in self._changed:
            self._changed.append(message.param_id)

    def _decoded(self, message: Message) -> float:
        value: float = message.param_value
        if self._firmware == "px4" and message.param_type == mavlink.MAV_PARAM_TYPE_INT32:
            (value,) = struct.unpack("<i", struct.pack("<f", value))
        return float(value)

    def _note_origin(self, origin: Place) -> None:
        """Check the origin: a compass simulated at one place is corrected with another's charts."""
        if self._home is None or origin == self._origin:
            return
        self._origin = origin
        off_m = math.hypot(*offset_ned_m(self._home, origin)[:2])
        if off_m > MAX_ORIGIN_OFF_M:
            lat, lon, _ = self._home
            self._report(
                f"its origin is {off_m / 1000:.0f} km from where it is simulated: in the "
                f"companion's [link], origin_lat_deg = {lat / 1e7:.4f}, "
                f"origin_lon_deg = {lon / 1e7:.4f}; then restart both"
            )

    def requests(self, now_s: float, home: Place | None) -> list[Message]:
        """Requests to send now; `home` is the simulated location on Earth."""
        self._home = home
        if self._target is None or now_s - self._asked_s < ASK_PERIOD_S:
            return []
        self._asked_s = now_s
        self._announce()
        messages = self._stream_requests(now_s)
        if home is not None and self._origin is None:
            origin = (mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,)
            messages.append(command_long(self._target, mavlink.MAV_CMD_REQUEST_MESSAGE, origin))
        for name, value in self._missing.items():
            messages += self._parameter_requests(name, value)
        return messages

    def _stream_requests(self, now_s: float) -> list[Message]:
        assert self._target is not None
        truth = TRUTH_MESSAGE[self._firmware], TRUTH_HZ, self._truth_s
        attitude = mavlink.MAVLINK_MSG_ID_ATTITUDE, ATTITUDE_HZ, self._attitude_s
        return [
            command_long(
                self._target, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (message_id, 1e6 / rate_hz)
            )
            for message_id, rate_hz, seen_s in (truth, attitude)
            if now_s - seen_s > ASK_PERIOD_S
        ]

    def _parameter_requests(self, name: str, value: float) -> list[Message]:
        """Read a parameter first; set it if its value differs."""
        assert self._target is not None
        if name not in self._changed:
            return [mavlink.MAVLink_param_request_read_message(*self._target, name.encode(), -1)]
        kind = load_table(self._firmware)[name].kind
        wire = value
        if self._firmware == "px4" and kind == mavlink.MAV_PARAM_TYPE_INT32:
            (wire,) = struct.unpack("<f", struct.pack("<i", int(value)))
        return [mavlink.MAVLink_param_set_message(*self._target, name.encode(), wire, kind)]

    def _announce(self) -> None:
        if self._is_ready or self._missing:
            return
        self._is_ready = True
        restart = [name for name in self._changed if name in NEEDS_RESTART]
        self._report(f"parameters set: {', '.join(self._changed) or 'none needed'}")
        if restart:
            self._report(f"restart the autopilot once so that it reads {', '.join(restart)}")

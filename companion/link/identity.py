"""Identifies the autopilot: its firmware with version, and its board."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.requests import RESEND_S, command_long
from companion.link.transports.transport import Message


class AutopilotIdentity:
    """Requests AUTOPILOT_VERSION (148) until it is received; a `Listener`."""

    def __init__(self, system_id: int) -> None:
        self.streams_hz = {int(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION): 0.0}
        self._target = system_id, int(mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._asked_s = float("-inf")
        self.text = ""
        """Version, hash of the source, and number of the board; empty until received."""

    def receive(self, message: Message, now_s: float) -> None:
        version = ".".join(str(message.flight_sw_version >> shift & 0xFF) for shift in (24, 16, 8))
        source = bytes(message.flight_custom_version).rstrip(b"\0").hex() or "0"
        board = bytes(message.uid2).rstrip(b"\0").hex() or f"{message.uid:x}"
        self.text = f"version {version}, source {source}, board {board}"

    def requests(self, now_s: float) -> list[Message]:
        """The request, if it is due."""
        if self.text or now_s - self._asked_s < RESEND_S:
            return []
        self._asked_s = now_s
        wanted = float(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        return [command_long(self._target, mavlink.MAV_CMD_REQUEST_MESSAGE, (wanted,))]

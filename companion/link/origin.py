"""Sets the autopilot's global origin, which its estimator needs even without GPS.

    UNKNOWN ──request──► REQUESTED ──one period without an answer──► SET, every period
        ▲                  └───────── GPS_GLOBAL_ORIGIN ────────────────┴──► KNOWN
        └── the autopilot has restarted ──────────────────────────────────────┘

An origin that the autopilot already has is kept. Only the companion sets one.
"""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.link.requests import command_long
from companion.link.transports.transport import Message

ASK = (mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,)
"""Parameters of MAV_CMD_REQUEST_MESSAGE (512): the id of the requested message."""


class Origin:
    """Global origin of one vehicle."""

    def __init__(self, config: LinkConfig) -> None:
        self._ours = (
            config.system_id,
            round(1e7 * config.origin_lat_deg),
            round(1e7 * config.origin_lon_deg),
            round(1e3 * config.origin_alt_m),
        )
        self._is_known = self._was_asked = False

    def receive(self) -> None:
        """Note that GPS_GLOBAL_ORIGIN (49) was received."""
        self._is_known = True

    def forget(self) -> None:
        """Start again, after a reboot of the autopilot."""
        self._is_known = self._was_asked = False

    def requests(self, target: tuple[int, int]) -> list[Message]:
        """Messages to send once per period; none once the origin is known."""
        if self._is_known:
            return []
        messages = [command_long(target, mavlink.MAV_CMD_REQUEST_MESSAGE, ASK)]
        if self._was_asked:
            messages.append(mavlink.MAVLink_set_gps_global_origin_message(*self._ours))
        self._was_asked = True
        return messages

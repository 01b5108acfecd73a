"""Where on Earth the autopilot's position begins, which estimators need although there is no GPS.

    NOT KNOWN ──asked──► ASKED ──a period without an answer──► GIVEN, again and again
        ▲                  └───────── GPS_GLOBAL_ORIGIN ──────────┴──► KNOWN
        └── the autopilot has restarted ──────────────────────────────────┘

An autopilot that has one keeps it. Nobody but the companion gives it one.
"""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.link.requests import command_long
from companion.link.transports.transport import Message

ASK = (mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,)


class Origin:
    """Of one vehicle."""

    def __init__(self, config: LinkConfig) -> None:
        self._ours = (
            config.system_id,
            round(1e7 * config.origin_lat_deg),
            round(1e7 * config.origin_lon_deg),
            round(1e3 * config.origin_alt_m),
        )
        self._is_known = self._was_asked = False

    def hear(self) -> None:
        """GPS_GLOBAL_ORIGIN (49) has come."""
        self._is_known = True

    def forget(self) -> None:
        """The autopilot has rebooted."""
        self._is_known = self._was_asked = False

    def requests(self, target: tuple[int, int]) -> list[Message]:
        """What is sent once a period until it is known."""
        if self._is_known:
            return []
        messages = [command_long(target, mavlink.MAV_CMD_REQUEST_MESSAGE, ASK)]
        if self._was_asked:
            messages.append(mavlink.MAVLink_set_gps_global_origin_message(*self._ours))
        self._was_asked = True
        return messages

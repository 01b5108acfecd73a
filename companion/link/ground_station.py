"""A ground station's heartbeat beside our own: PX4 sends STATUSTEXT only where it hears one.

Why PX4 refuses to arm, and what fails in flight, it says in STATUSTEXT and nowhere else. It looks
at the type in HEARTBEAT alone, so a component of its own beats as a ground station, and 191 stays
an onboard controller.

PX4 cannot tell it from a real ground station on another link, whose loss it would hide. So it
beats only while `NAV_DLL_ACT` is 0, that is while PX4 does nothing when ground stations fall
silent; when ours stops, PX4 says "Connection to ground station lost" after `COM_DL_LOSS_T`, and
flies on.
"""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transports.transport import Message, sent_by

COMPONENT: int = mavlink.MAV_COMP_ID_MISSIONPLANNER


class GroundStation:
    """Numbers its heartbeats as a component of its own."""

    def __init__(self) -> None:
        self._number = 0

    def heartbeat(self) -> Message:
        """HEARTBEAT (0)."""
        beat = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
        )
        self._number += 1
        return sent_by(beat, COMPONENT, self._number)

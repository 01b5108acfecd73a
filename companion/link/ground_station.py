"""Sends a ground station's heartbeat, without which PX4 sends no STATUSTEXT on a link.

PX4 reports the reason of a refused arming, and failures in flight, only in STATUSTEXT. PX4 checks
only the type in HEARTBEAT. A separate component of the companion therefore sends heartbeats as a
ground station; component 191 stays an onboard controller.

PX4 cannot distinguish this component from a real ground station on another link, so it could mask
the loss of the real one. These heartbeats are therefore sent only while `NAV_DLL_ACT` is 0, which
means that PX4 takes no action when the ground station is lost. When they stop, PX4 reports
"Connection to ground station lost" after `COM_DL_LOSS_T` and continues the flight.
"""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transports.transport import Message, sent_by

COMPONENT: int = mavlink.MAV_COMP_ID_MISSIONPLANNER
"""MAVLink component id of these heartbeats."""


class GroundStation:
    """Heartbeat source with its own component id and sequence numbers."""

    def __init__(self) -> None:
        self._number = 0

    def heartbeat(self) -> Message:
        """HEARTBEAT (0) of type MAV_TYPE_GCS."""
        beat = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
        )
        self._number += 1
        return sent_by(beat, COMPONENT, self._number)

"""Tests whether a pilot can take the drone over: by the transmitter, and from which mode."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.firmware import Firmware
from companion.link.transports.transport import Message

RECEIVER = mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
"""Bit of SYS_STATUS (1). ArduPilot reports the receiver as present once it has received anything,
and as healthy until its failsafe. PX4 reports it as present while it receives valid sticks, and as
healthy even without one. Only both together mean a transmitter that is received now."""


class Pilot:
    """What the autopilot reports of the pilot's transmitter."""

    def __init__(self) -> None:
        self._is_received = False

    def receive(self, sys_status: Message) -> None:
        """Note a SYS_STATUS (1)."""
        both = (
            sys_status.onboard_control_sensors_present & sys_status.onboard_control_sensors_health
        )
        self._is_received = bool(both & RECEIVER)

    def complaint(self, firmware: Firmware, mode: str) -> str:
        """Reason why the pilot could not take the drone over, and the remedy; empty if he can."""
        if not self._is_received:
            return (
                "it receives no transmitter, which preflight.transmitter = true needs: switch the "
                "transmitter on, and bind its receiver"
            )
        if mode in firmware.holding_modes:
            return ""
        return (
            f"its mode is {mode}, to which the pilot's switch returns, and preflight.transmitter "
            f"= true needs one that holds the height: switch to {', '.join(firmware.holding_modes)}"
        )

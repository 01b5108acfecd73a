"""Holds the parts that the commander and the protocol of one vehicle share."""

from dataclasses import dataclass

from sitl.autopilot.estimation.navigation import Navigation
from sitl.autopilot.firmware import EmulatedFirmware
from sitl.autopilot.messages import Broadcast
from sitl.autopilot.parameters.protocol import Parameters
from sitl.autopilot.telemetry import Status, Telemetry


@dataclass(frozen=True, slots=True)
class Parts:
    """The parts of one flight controller."""

    firmware: EmulatedFirmware
    parameters: Parameters
    status: Status
    navigation: Navigation
    telemetry: Telemetry
    broadcast: Broadcast

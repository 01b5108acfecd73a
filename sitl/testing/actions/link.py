"""Faults of the MAVLink connection."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.core.radio import NO_LINK_ERRORS, LinkErrors
from sitl.simulation.simulation import Simulation
from sitl.testing.actions.action import Action

GROUND_STATION = 255
"""System id of most ground stations."""


def bad_link(
    loss: float = 0.0,
    duplicates: float = 0.0,
    reordering: float = 0.0,
    jitter_s: float = 0.0,
    for_s: float | None = None,
) -> Action:
    """Disturb MAVLink in both directions: shares of all messages, and the largest delay."""
    errors = LinkErrors(loss, duplicates, reordering, jitter_s)
    return Action(
        lambda simulation: simulation.disturb_link(errors),
        lambda simulation: simulation.disturb_link(NO_LINK_ERRORS),
        for_s,
    )


def link_down(for_s: float | None = None) -> Action:
    """Lose all MAVLink messages in both directions."""
    return bad_link(loss=1.0, for_s=for_s)


def other_rates(message: str, rate_hz: float) -> Action:
    """A ground station on the companion's link sets its own rate of a message; 0 stops it."""
    ids = {kind.msgname: number for number, kind in mavlink.mavlink_map.items()}
    if message not in ids:
        raise ValueError(f"no message {message!r} in MAVLink; as in 'ATTITUDE'")
    interval_us = 1e6 / rate_hz if rate_hz > 0 else -1.0

    def ask(simulation: Simulation) -> None:
        asked = mavlink.MAVLink_command_long_message(
            *(0, mavlink.MAV_COMP_ID_AUTOPILOT1),
            *(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, ids[message], interval_us, 0, 0, 0, 0, 0),
        )
        asked._header.srcSystem = GROUND_STATION
        asked._header.srcComponent = mavlink.MAV_COMP_ID_MISSIONPLANNER
        simulation.autopilot.receive(asked)

    return Action(ask)

"""Scripted flights for tests, in this project and in others; see docs/testing.md."""

from sitl.testing.actions.action import Action
from sitl.testing.actions.link import bad_link, link_down, other_rates
from sitl.testing.actions.sensors import (
    bias_gyro,
    break_bus,
    dead_adc,
    dead_gyro,
    hang_bus,
    noisy,
    saturate_gyro,
    stick,
    swap,
    unplug,
)
from sitl.testing.actions.surroundings import gust, hang, somebody, somebody_near, starve
from sitl.testing.actions.vehicle import (
    battery,
    claim,
    crash,
    jump_clock,
    jump_odometry,
    lose_flow,
    mute,
    pilot_arms,
    pilot_mode,
    refuse_arming,
    restart_autopilot,
    stay_taking_off,
)
from sitl.testing.flight import Flight, Sitl
from sitl.testing.script import Event, at, optional, watch, when

__all__ = [
    "Action",
    "Event",
    "Flight",
    "Sitl",
    "at",
    "bad_link",
    "battery",
    "bias_gyro",
    "break_bus",
    "claim",
    "crash",
    "dead_adc",
    "dead_gyro",
    "gust",
    "hang",
    "hang_bus",
    "jump_clock",
    "jump_odometry",
    "link_down",
    "lose_flow",
    "mute",
    "noisy",
    "optional",
    "other_rates",
    "pilot_arms",
    "pilot_mode",
    "refuse_arming",
    "restart_autopilot",
    "saturate_gyro",
    "somebody",
    "somebody_near",
    "starve",
    "stay_taking_off",
    "stick",
    "swap",
    "unplug",
    "watch",
    "when",
]

"""Scripted flights for tests, in this project's own and in yours; see docs/testing.md."""

from sitl.testing.flight import Flight, Sitl
from sitl.testing.script import (
    Action,
    Event,
    at,
    break_bus,
    crash,
    link_down,
    pilot_mode,
    somebody,
    unplug,
    when,
)

__all__ = [
    "Action",
    "Event",
    "Flight",
    "Sitl",
    "at",
    "break_bus",
    "crash",
    "link_down",
    "pilot_mode",
    "somebody",
    "unplug",
    "when",
]

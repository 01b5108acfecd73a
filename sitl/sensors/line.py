"""Runs the companion's wires on virtual time: a slow request continues after its timeout."""

import errno
from collections.abc import Callable
from typing import TypeVar

from companion.drivers.wires.prompt import PromptWires
from sitl.sensors.i2c import DeviceBus

Answer = TypeVar("Answer")


class VirtualLine:
    """Replaces the thread that the companion runs for each wire."""

    def __init__(self, bus: DeviceBus) -> None:
        self._bus = bus
        self._free_at_s = 0.0

    @property
    def is_busy(self) -> bool:
        return self._bus.time_s < self._free_at_s

    def ask(self, request: Callable[[], Answer], within_s: float) -> Answer:
        began_s = self._bus.time_s
        try:
            return request()
        finally:
            if self._bus.time_s - began_s > within_s:
                self._free_at_s = self._bus.time_s
                self._bus.set_back(began_s + within_s)
                raise TimeoutError(errno.ETIMEDOUT, f"no answer in {within_s:.2g} s")

    def close(self) -> None:
        """Do nothing: there is no thread to end."""


def on_virtual_time(bus: DeviceBus) -> PromptWires:
    """Wires as on a real machine, but on the bus's time."""
    return PromptWires(bus, lambda: VirtualLine(bus), lambda: bus.time_s)

"""Something done to the simulation, and how it is undone."""

from collections.abc import Callable
from dataclasses import dataclass

from sitl.simulation.simulation import Simulation

Switch = Callable[[Simulation], None]


def _for_good(simulation: Simulation) -> None:
    """It is never taken back."""


@dataclass(frozen=True, slots=True)
class Action:
    """Something done to the simulation, and how it is undone after a while, if it is."""

    begin: Switch
    undo: Switch = _for_good
    for_s: float | None = None

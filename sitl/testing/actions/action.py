"""Defines an action on the simulation and its reversal."""

from collections.abc import Callable
from dataclasses import dataclass

from sitl.simulation.simulation import Simulation

Switch = Callable[[Simulation], None]


def _for_good(simulation: Simulation) -> None:
    """Do nothing: the action is permanent."""


@dataclass(frozen=True, slots=True)
class Action:
    """An action on the simulation; `undo` reverses it after `for_s`, if given."""

    begin: Switch
    undo: Switch = _for_good
    for_s: float | None = None

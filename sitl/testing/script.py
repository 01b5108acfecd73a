"""What happens in a scripted flight, and when: faults, and what the pilot does.

script=[at(30, link_down(for_s=5)), when("scanning", pilot_mode("LOITER"))]
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from companion.app import App
from sitl.simulation.simulation import Simulation
from sitl.testing.actions.action import Action


@dataclass(frozen=True, slots=True)
class Event:
    """An action and the condition on which it begins, once.

    A flight in which it never begins has not tested what it should, unless it is optional.
    """

    is_due: Callable[[Simulation, App], bool]
    action: Action
    is_optional: bool = False
    name: str = "an Event of its own"
    """As it is told when it never happened."""


def at(time_s: float, action: Action) -> Event:
    """At a time of the flight, seconds since the start."""
    return Event(
        lambda simulation, app: simulation.time_s >= time_s, action, name=f"at {time_s:g} s"
    )


def when(activity: str, action: Action) -> Event:
    """When the companion first says that it does something, such as "scanning"."""
    return Event(
        lambda simulation, app: activity in app.flight.activity, action, name=f"when {activity!r}"
    )


def optional(event: Event) -> Event:
    """The same, in a flight that may end before it happens."""
    return replace(event, is_optional=True)


def watch(look: Callable[[Simulation, App], object]) -> Event:
    """Nothing happens, but `look` is called at every tick."""

    def is_due(simulation: Simulation, app: App) -> bool:
        look(simulation, app)
        return False

    return Event(is_due, Action(lambda simulation: None), is_optional=True)


class Play:
    """The script that carries out the events, each once, and undoes them when their time is up."""

    def __init__(self, events: Sequence[Event]) -> None:
        self._waiting = list(events)
        self._running: list[tuple[float, Action]] = []

    def __call__(self, simulation: Simulation, app: App) -> None:
        """One tick."""
        for event in [event for event in self._waiting if event.is_due(simulation, app)]:
            self._waiting.remove(event)
            event.action.begin(simulation)
            if event.action.for_s is not None:
                self._running.append((simulation.time_s + event.action.for_s, event.action))
        for until_s, action in [r for r in self._running if simulation.time_s >= r[0]]:
            self._running.remove((until_s, action))
            action.undo(simulation)

    @property
    def missed(self) -> str:
        """What should have happened and has not; nothing if all has."""
        return ", ".join(event.name for event in self._waiting if not event.is_optional)

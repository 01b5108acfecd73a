"""Scripts a flight: faults and pilot actions, each with its condition.

script=[at(30, link_down(for_s=5)), when("scanning", pilot_mode("LOITER"))]
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from companion.app import App
from sitl.simulation.simulation import Simulation
from sitl.testing.actions.action import Action


@dataclass(frozen=True, slots=True)
class Event:
    """An action and its start condition; it starts at most once.

    A test fails if an event that is not optional has not started by the end of the flight.
    """

    is_due: Callable[[Simulation, App], bool]
    action: Action
    is_optional: bool = False
    name: str = "an Event of its own"
    """Name in the error message about events that did not happen."""


def at(time_s: float, action: Action) -> Event:
    """Event at a time of the flight, s since the start."""
    return Event(
        lambda simulation, app: simulation.time_s >= time_s, action, name=f"at {time_s:g} s"
    )


def when(activity: str, action: Action) -> Event:
    """Event at the first tick in which the companion's activity contains this text."""
    return Event(
        lambda simulation, app: activity in app.flight.activity, action, name=f"when {activity!r}"
    )


def optional(event: Event) -> Event:
    """The event, but the flight may end before it."""
    return replace(event, is_optional=True)


def watch(look: Callable[[Simulation, App], object]) -> Event:
    """No event: call `look` at every tick."""

    def is_due(simulation: Simulation, app: App) -> bool:
        look(simulation, app)
        return False

    return Event(is_due, Action(lambda simulation: None), is_optional=True)


class Play:
    """Runs the events, each once, and undoes timed ones."""

    def __init__(self, events: Sequence[Event]) -> None:
        self._waiting = list(events)
        self._running: list[tuple[float, Action]] = []

    def __call__(self, simulation: Simulation, app: App) -> None:
        """Process one tick."""
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
        """Names of the events that have not happened but should have; empty if none."""
        return ", ".join(event.name for event in self._waiting if not event.is_optional)

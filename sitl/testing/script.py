"""What happens in a scripted flight, and when: faults, and what the pilot does.

script=[at(30, link_down(for_s=5)), when("scanning", pilot_mode("LOITER"))]
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from companion.app import App
from companion.link.dialect import ARDUCOPTER_MODES, PX4_MODES
from companion.messages import Beam
from sitl.lockstep import Script
from sitl.simulation import Simulation

Switch = Callable[[Simulation], None]


def _for_good(simulation: Simulation) -> None:
    """It is never taken back."""


@dataclass(frozen=True, slots=True)
class Action:
    """Something done to the simulation, and how it is undone after a while, if it is."""

    begin: Switch
    undo: Switch = _for_good
    for_s: float | None = None


@dataclass(frozen=True, slots=True)
class Event:
    """An action and the condition on which it begins, once."""

    is_due: Callable[[Simulation, App], bool]
    action: Action


def at(time_s: float, action: Action) -> Event:
    """At a time of the flight, seconds since the start."""
    return Event(lambda simulation, app: simulation.time_s >= time_s, action)


def when(activity: str, action: Action) -> Event:
    """When the companion first says that it does something, such as "scanning"."""
    return Event(lambda simulation, app: activity in app.flight.activity, action)


def link_down(for_s: float | None = None) -> Action:
    """MAVLink is lost in both directions."""

    def switch(*, down: bool) -> Switch:
        def turn(simulation: Simulation) -> None:
            simulation.is_link_down = down

        return turn

    return Action(switch(down=True), switch(down=False), for_s)


def break_bus(for_s: float | None = None) -> Action:
    """No sensor answers."""

    def switch(*, broken: bool) -> Switch:
        def turn(simulation: Simulation) -> None:
            simulation.board.bus.is_broken = broken

        return turn

    return Action(switch(broken=True), switch(broken=False), for_s)


def unplug(beam: str) -> Action:
    """A range sensor loses its plug: "front", "left", "right", "up" or "down"."""
    if beam not in list(Beam):
        raise ValueError(f"no beam {beam!r}; known: {', '.join(Beam)}")
    return Action(lambda simulation: simulation.board.unplug(beam))


def somebody(places: Sequence[tuple[float, float, float]], for_s: float | None = None) -> Action:
    """People stand at these places: north, east and height, metres, of head and shoulders."""
    bodies = [(north_m, east_m, -height_m) for north_m, east_m, height_m in places]

    def come(simulation: Simulation) -> None:
        simulation.bystanders += bodies

    def go(simulation: Simulation) -> None:
        for body in bodies:
            simulation.bystanders.remove(body)

    return Action(come, go, for_s)


def crash(reason: str = "test") -> Action:
    """The autopilot disarms as after hitting something."""
    return Action(lambda simulation: simulation.autopilot.crash(reason))


def pilot_mode(name: str) -> Action:
    """The pilot's mode switch: "LOITER", "LAND", PX4's "POSCTL" and so on."""
    numbers = {
        mode: number for modes in (ARDUCOPTER_MODES, PX4_MODES) for number, mode in modes.items()
    }
    if name not in numbers:
        raise ValueError(f"no mode {name!r}; known: {', '.join(sorted(numbers))}")
    return Action(lambda simulation: simulation.autopilot.pilot_mode(numbers[name]))


def play(events: Sequence[Event]) -> Script:
    """The script that carries out the events, each once, and undoes them when their time is up."""
    waiting = list(events)
    running: list[tuple[float, Action]] = []

    def script(simulation: Simulation, app: App) -> None:
        for event in [event for event in waiting if event.is_due(simulation, app)]:
            waiting.remove(event)
            event.action.begin(simulation)
            if event.action.for_s is not None:
                running.append((simulation.time_s + event.action.for_s, event.action))
        for until_s, action in [r for r in running if simulation.time_s >= r[0]]:
            running.remove((until_s, action))
            action.undo(simulation)

    return script

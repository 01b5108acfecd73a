"""Flies a team in lockstep: all drones in one world, on one virtual clock, in one process.

A single drone flies as in `lockstep.py`.

    drone 1: autopilot, sensors ◄──► companion ◄─┐
    drone 2: autopilot, sensors ◄──► companion ◄─┼─► simulated radio
    ...                                          │

Each tick is of the drone that is due next. Before it, time advances for all.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from companion.app import App
from companion.config.settings import Config
from companion.earlier import EarlierFlights
from companion.link.transports.transport import direct_pair
from companion.recording.recorder import NOT_RECORDED, Recorder
from companion.run.hardware import make_rig
from companion.run.loop import ControlLoop
from companion.ticks import Progress
from sitl.autopilot.core import keep_nothing
from sitl.core.radio import LinkErrors
from sitl.sensors.line import on_virtual_time
from sitl.simulation.fleet import Fleet
from sitl.simulation.simulation import Setup, Simulation
from sitl.simulation.team_radio import USUAL_ERRORS, TeamAir

Watch = Callable[[int, Progress], None]
"""Called at every tick with the drone's number, from 0, and its progress."""
Script = Callable[[Fleet, Sequence[App], TeamAir], None]
"""Called before every tick; may inject faults."""


def no_script(fleet: Fleet, apps: Sequence[App], air: TeamAir) -> None:
    """The empty script."""


@dataclass(frozen=True, slots=True)
class TeamFlight:
    """A team at the end of its flight."""

    apps: tuple[App, ...]
    fleet: Fleet
    air: TeamAir


class _Clock:
    """The clock of one drone; only the caller of its loop waits."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def wait_until(self, time_s: float) -> float:
        raise NotImplementedError("the team's clock advances all drones together")

    def now_s(self) -> float:
        return self._simulation.time_s

    def close(self) -> None:
        """No resource to release."""


def fly_team_in_lockstep(
    setups: Sequence[Setup],
    configs: Sequence[Config],
    watch: Watch,
    *,
    script: Script = no_script,
    recorders: Sequence[Recorder] = (),
    earlier: Sequence[EarlierFlights | None] = (),
    radio_errors: LinkErrors = USUAL_ERRORS,
    land_requested: Callable[[], bool] = lambda: False,
    make_app: Callable[[Config, EarlierFlights | None], App] = App,
) -> TeamFlight:
    """Fly until the last drone has ended; each drone has a setup and a configuration.

    `earlier`: what each drone knows from the flights before, if anything. `make_app` can replace
    `App`.
    """
    pairs = [direct_pair(setup.system_id) for setup in setups]
    fleet = Fleet(setups, [[ours] for ours, _ in pairs], keep_nothing)
    air = TeamAir(setups[0].seed, len(setups), lambda: fleet.time_s, radio_errors)
    apps = tuple(map(make_app, configs, earlier or [None] * len(configs)))
    recorders = recorders or [NOT_RECORDED] * len(setups)
    loops: list[ControlLoop] = []
    for number, (app, config, vehicle) in enumerate(
        zip(apps, configs, fleet.vehicles, strict=True)
    ):
        link = recorders[number].tap(pairs[number][1])
        wires = on_virtual_time(vehicle.board.bus)
        rig = make_rig(config, link, wires, _Clock(vehicle), air.radios[number])
        record = recorders[number].tick
        loops.append(ControlLoop(app, rig, _watch_of(watch, number), land_requested, record))
    due_s: dict[int, float] = dict.fromkeys(range(len(loops)), 0.0)
    while due_s:
        number = min(due_s, key=lambda each: (due_s[each], each))
        vehicle = fleet.vehicles[number]
        free_s = max(vehicle.companion_hangs_until_s, vehicle.board.bus.hung_until_s)
        if free_s > due_s[number]:
            due_s[number] = free_s
            continue
        fleet.advance(due_s[number])
        script(fleet, apps, air)
        later_s = loops[number].tick(fleet.time_s)
        if later_s is None:
            del due_s[number]
        else:
            due_s[number] = max(later_s, fleet.time_s)
    return TeamFlight(apps, fleet, air)


def _watch_of(watch: Watch, number: int) -> Callable[[Progress], None]:
    return lambda progress: watch(number, progress)

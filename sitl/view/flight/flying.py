"""Flies in a separate process: in lockstep, paced, with orders from the page."""

import time
from collections.abc import Sequence
from multiprocessing.connection import Connection

from companion.app import App
from companion.config.settings import Config
from companion.core.errors import CompanionError
from companion.core.messages import FloorPlan
from companion.recording.recorder import NotRecorded
from companion.ticks import Inputs, Outputs, Progress
from companion.view.snapshot import snapshot
from sitl.core.errors import SitlError
from sitl.scoring.team_report import merged_flights
from sitl.simulation.fleet import Fleet
from sitl.simulation.simulation import Simulation
from sitl.simulation.team import fly_team_in_lockstep
from sitl.simulation.team_radio import TeamAir
from sitl.testing.actions.vehicle import ModeError
from sitl.testing.script import Event, Play
from sitl.view.faults import action
from sitl.view.flight.messages import (
    Begin,
    Ended,
    GiveUp,
    Inject,
    Land,
    Order,
    Pace,
    Refused,
    Seen,
    SeenDrone,
    Step,
)
from sitl.view.flight.outbox import Outbox
from sitl.world.loading import load_world

SEEN_PERIOD_S = 0.05
"""Shortest period of the reports, wall time, s."""
SKETCH_PERIOD_S = 0.5
"""Shortest period of the maps, wall time, s."""
FLOWN_SKETCH_PERIOD_S = 1.0
"""Shortest period of the maps, simulated time, s."""
MAX_BEHIND_S = 0.5
"""A flight that is later than this, wall time, s, does not catch up."""


class _GivenUpError(Exception):
    """The flight is cancelled, possibly for another one."""

    def __init__(self, instead: Begin | None) -> None:
        super().__init__()
        self.instead = instead


def serve(orders: Connection) -> None:
    """Fly as ordered, one flight after another, until the page closes the connection."""
    outbox = Outbox(orders)
    order: Order | None = None
    try:
        while True:
            order = order or orders.recv()
            order = _fly(order, orders, outbox) if isinstance(order, Begin) else None
    except (EOFError, OSError, KeyboardInterrupt):
        return


def _fly(order: Begin, orders: Connection, outbox: Outbox) -> Begin | None:
    """Fly one flight; return the next order if one arrived during it."""
    try:
        setups, configs = order.request.setups(load_world(order.request.world))
        flight = PacedFlight(order, orders, outbox, configs)
        flown = fly_team_in_lockstep(
            setups,
            configs,
            _ignore,
            script=flight.before_tick,
            recorders=flight.recorders,
            land_requested=lambda: flight.is_to_land,
        )
    except _GivenUpError as given_up:
        return given_up.instead
    except (SitlError, CompanionError) as error:
        outbox.put(Refused(str(error)))
        return None
    endings = tuple(app.flight.ending for app in flown.apps)
    outbox.put(Ended(order.flight, endings, *_final_map(configs, flown.apps)))
    return None


def _ignore(number: int, progress: Progress) -> None:
    """Ignore the progress: the page gets it from the flight's recorders."""


def _final_map(configs: Sequence[Config], apps: Sequence[App]) -> tuple[FloorPlan, tuple[int, ...]]:
    """The map of all flights, and the drone of each path in it."""
    if len(apps) == 1:
        return apps[0].final_floor_plan(), (0,)
    try:
        merged = merged_flights(configs, apps)
    except SitlError:  # no drone has flown
        return FloorPlan(), ()
    drones = tuple(int(flight.name.split()[-1]) - 1 for flight in merged.flights)
    return merged.plan, drones


class _DroneRecorder(NotRecorded):
    """Passes on each tick of one drone."""

    def __init__(self, flight: "PacedFlight", number: int) -> None:
        self._flight, self._number = flight, number

    def tick(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        self._flight.record(self._number, now_s, inputs, outputs)


class PacedFlight:
    """Paces a flight, executes orders, and reports to the page."""

    def __init__(
        self, begin: Begin, orders: Connection, outbox: Outbox, configs: Sequence[Config]
    ) -> None:
        self._flight = begin.flight
        self._orders = orders
        self._outbox = outbox
        self._configs = configs
        self._scripts: list[tuple[int, Play]] = []
        """Number of the drone, and what happens to it."""
        self._parts: list[tuple[Simulation, App]] = []
        self._latest: dict[int, tuple[float, Inputs, Outputs]] = {}
        """Latest tick of each drone."""
        self._ticked_s = float("-inf")
        self._is_stepping = False
        self._seen_wall_s = self._sketched_wall_s = self._sketched_s = float("-inf")
        self.is_to_land = False
        self._pace(begin.speed, 0.0)
        self.recorders = [_DroneRecorder(self, number) for number in range(len(configs))]

    # Before each tick: a script of `simulation.team`.

    def before_tick(self, fleet: Fleet, apps: Sequence[App], air: TeamAir) -> None:
        if fleet.time_s <= self._ticked_s:
            return  # another drone's tick at the same time
        self._ticked_s = fleet.time_s
        self._parts = list(zip(fleet.vehicles, apps, strict=True))
        while self._orders.poll(self._wait_s(fleet.time_s)):
            self._execute(self._orders.recv(), fleet.time_s)
        self._is_stepping = False
        for drone, play in self._scripts:
            try:
                play(*self._parts[drone])
            except ModeError as error:  # of the other autopilot
                self._outbox.put(Refused(str(error)))

    def _wait_s(self, time_s: float) -> float | None:
        """Time to wait for orders before the tick, s; None: until there is one."""
        if self._speed == 0:
            return 0.0 if self._is_stepping else None
        ahead_s = (time_s - self._since_s) / self._speed - (time.monotonic() - self._since_wall_s)
        if ahead_s < -MAX_BEHIND_S:
            self._pace(self._speed, time_s)
        return max(ahead_s, 0.0)

    def _pace(self, speed: float, time_s: float) -> None:
        self._speed = speed
        self._since_s, self._since_wall_s = time_s, time.monotonic()

    def _execute(self, order: Order, time_s: float) -> None:
        match order:
            case Begin():
                raise _GivenUpError(order)
            case GiveUp():
                raise _GivenUpError(None)
            case Pace(speed):
                self._pace(speed, time_s)
                self._report()
            case Step():
                self._pace(0.0, time_s)
                self._is_stepping = True
            case Land():
                self.is_to_land = True
            case Inject(drone, name, arguments):
                event = Event(_at_once, action(name, arguments))
                self._scripts.append((drone, Play([event])))

    # After each tick

    def record(self, number: int, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        self._latest[number] = now_s, inputs, outputs
        is_due = time.monotonic() - self._seen_wall_s >= SEEN_PERIOD_S
        if is_due or self._speed == 0 or outputs.finished:
            self._report()

    def _report(self) -> None:
        """Report the latest tick of every drone, once each has had one."""
        if len(self._latest) < len(self._configs):
            return
        wall_s = self._seen_wall_s = time.monotonic()
        with_sketch = (
            wall_s - self._sketched_wall_s >= SKETCH_PERIOD_S
            and self._ticked_s - self._sketched_s >= FLOWN_SKETCH_PERIOD_S
        )
        if with_sketch:
            self._sketched_wall_s, self._sketched_s = wall_s, self._ticked_s
        drones = (self._seen(number, with_sketch=with_sketch) for number in sorted(self._latest))
        self._outbox.put(Seen(self._flight, self._ticked_s, tuple(drones)))

    def _seen(self, number: int, *, with_sketch: bool) -> SeenDrone:
        (simulation, app), latest = self._parts[number], self._latest[number]
        return SeenDrone(
            snapshot(app, *latest, self._configs[number], with_sketch=with_sketch),
            simulation.autopilot.truth,
            simulation.record.clearance_m,
            simulation.record.collisions,
        )


def _at_once(simulation: Simulation, app: App) -> bool:
    return True

"""Flies in a separate process: in lockstep, paced, with orders from the page."""

import time
from multiprocessing.connection import Connection

from companion.app import App, Inputs, Outputs, Progress
from companion.config.settings import Config
from companion.core.errors import CompanionError
from companion.core.messages import FloorPlan
from companion.link.transports.transport import Transport
from companion.view.snapshot import snapshot
from sitl.core.errors import SitlError
from sitl.scoring.report import make_report
from sitl.simulation.lockstep import Script, fly_in_lockstep
from sitl.simulation.simulation import Simulation
from sitl.testing.actions.vehicle import pilot_mode
from sitl.testing.script import Event, Play
from sitl.view.faults import FAULTS
from sitl.view.flight_messages import (
    Begin,
    Ended,
    GiveUp,
    Inject,
    Land,
    Order,
    Pace,
    Refused,
    Seen,
    Step,
    TakeOver,
)
from sitl.view.outbox import Outbox

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
    began_s = time.monotonic()
    try:
        config = order.request.config()
        setup = order.request.setup(config)
        flight = PacedFlight(order, orders, outbox, config)
        app, simulation = fly_in_lockstep(
            setup,
            config,
            _ignore,
            script=flight.before_tick,
            recorder=flight,
            land_requested=lambda: flight.is_to_land,
        )
    except _GivenUpError as given_up:
        return given_up.instead
    except (SitlError, CompanionError) as error:
        outbox.put(Refused(str(error)))
        return None
    plan = app.final_floor_plan()
    waited_s = time.monotonic() - began_s
    truth = simulation.record
    report = make_report(setup, config, plan, truth, outcome=app.flight, waited_s=waited_s)
    outbox.put(Ended(order.flight, app.flight.ending, plan, report))
    return None


def _ignore(progress: Progress) -> None:
    """Ignore the progress: the page gets it from the flight's recorder."""


class PacedFlight:
    """Paces a flight, executes orders, and reports to the page."""

    def __init__(self, begin: Begin, orders: Connection, outbox: Outbox, config: Config) -> None:
        self._flight = begin.flight
        self._orders = orders
        self._outbox = outbox
        self._mount_offset_m = config.sensors.mount_offset_m
        self._scripts: list[Script] = []
        self._parts: tuple[Simulation, App] | None = None
        self._latest: tuple[float, Outputs] | None = None
        self._is_stepping = False
        self._seen_wall_s = self._sketched_wall_s = self._sketched_s = float("-inf")
        self.is_to_land = False
        self._pace(begin.speed, 0.0)

    # Before each tick: a script of `lockstep`.

    def before_tick(self, simulation: Simulation, app: App) -> None:
        self._parts = simulation, app
        while self._orders.poll(self._wait_s(simulation.time_s)):
            self._execute(self._orders.recv(), simulation)
        self._is_stepping = False
        for script in self._scripts:
            script(simulation, app)

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

    def _execute(self, order: Order, simulation: Simulation) -> None:
        match order:
            case Begin():
                raise _GivenUpError(order)
            case GiveUp():
                raise _GivenUpError(None)
            case Pace(speed):
                self._pace(speed, simulation.time_s)
                self._report()
            case Step():
                self._pace(0.0, simulation.time_s)
                self._is_stepping = True
            case Land():
                self.is_to_land = True
            case TakeOver(mode, throttle):
                self._scripts.append(Play([Event(_at_once, pilot_mode(mode, throttle))]))
            case Inject(fault, beam, for_s):
                action = FAULTS[fault](simulation, beam, for_s)
                self._scripts.append(Play([Event(_at_once, action)]))

    # After each tick: a recorder as in `recording`.

    def tap(self, transport: Transport) -> Transport:
        return transport

    def tick(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        self._latest = now_s, outputs
        is_due = time.monotonic() - self._seen_wall_s >= SEEN_PERIOD_S
        if is_due or self._speed == 0 or outputs.finished:
            self._report()

    def close(self, plan: FloorPlan) -> None:
        """Do nothing: the map goes to the page with the report."""

    def _report(self) -> None:
        if self._parts is None or self._latest is None:
            return
        (simulation, app), (now_s, outputs) = self._parts, self._latest
        wall_s = self._seen_wall_s = time.monotonic()
        with_sketch = (
            wall_s - self._sketched_wall_s >= SKETCH_PERIOD_S
            and now_s - self._sketched_s >= FLOWN_SKETCH_PERIOD_S
        )
        if with_sketch:
            self._sketched_wall_s, self._sketched_s = wall_s, now_s
        self._outbox.put(
            Seen(
                self._flight,
                snapshot(app, now_s, outputs, self._mount_offset_m, with_sketch=with_sketch),
                simulation.autopilot.truth,
                simulation.record.clearance_m,
                simulation.record.collisions,
                simulation.autopilot.battery,
            )
        )


def _at_once(simulation: Simulation, app: App) -> bool:
    return True

"""Runs the control loop: reads inputs, steps the flight and sends its outputs, 20 times a second.

The same loop runs on the drone, in SITL with two processes, and in SITL in one process in lockstep.
Only the clock, the link's transport and the bus differ, and these are parameters.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

from companion.app import App
from companion.core.messages import STALE, RangeScan
from companion.drivers.gyro import Gyro
from companion.link.link import Link
from companion.link.reports import Reports
from companion.pdps.flight.order import Order
from companion.run.clocks import Clock
from companion.safety.health.lateness import TICK_S
from companion.team.radio import NoRadio, TeamRadio
from companion.ticks import Inputs, Outputs, Progress

READ_S = 0.06
"""Maximum time to read one kind of input, s.

Chosen: a longer read means that the process was suspended, so the time of the data is unknown.
"""

Record = Callable[[float, Inputs, Outputs], None]
"""Callback at the end of every tick: time (s), inputs, outputs."""


def record_nothing(now_s: float, inputs: Inputs, outputs: Outputs) -> None:
    """Callback of a flight without a recording."""


class Ranges(Protocol):
    """Interface of the range sensors of all beams."""

    def read(self, time_s: float) -> RangeScan: ...


@dataclass(frozen=True, slots=True)
class Rig:
    """External interfaces of a flight."""

    link: Link
    ranges: Ranges
    gyro: Gyro
    clock: Clock
    reports: Reports
    team: TeamRadio = field(default_factory=NoRadio)


class ControlLoop:
    """The control loop of one flight."""

    def __init__(
        self,
        app: App,
        rig: Rig,
        watch: Callable[[Progress], None],
        land_requested: Callable[[], bool] = lambda: False,
        record: Record = record_nothing,
        *,
        orders: Callable[[], Order | None] = lambda: None,
    ) -> None:
        self._app, self._rig = app, rig
        self._watch, self._record = watch, record
        self._land_requested, self._orders = land_requested, orders
        self._tick = 0

    def run(self) -> None:
        """Run the flight until it ends for any reason; then nobody waits for its clock."""
        due_s: float | None = 0.0
        while due_s is not None:
            due_s = self.tick(self._rig.clock.wait_until(due_s))
        self._rig.clock.close()

    def tick(self, began_s: float) -> float | None:
        """Run the tick that began now, s; return the time of the next, or None at the end."""
        rig = self._rig
        inputs, now_s = _read(rig, began_s, self._land_requested(), self._orders())
        outputs = self._app.step(now_s, inputs)
        rig.link.send(now_s, outputs.setpoint, outputs.command, outputs.pose)
        flight = outputs.flight
        texts = flight.activity, flight.trouble, flight.notice
        rig.link.transmit(rig.reports.due(now_s, outputs.scan, *texts))
        rig.team.send(outputs.team)
        self._record(now_s, inputs, outputs)
        self._watch(outputs.progress)
        if outputs.finished:
            return None
        self._tick = max(self._tick + 1, int(began_s / TICK_S))
        return self._tick * TICK_S


def _read(rig: Rig, now_s: float, land: bool, order: Order | None) -> tuple[Inputs, float]:
    """Inputs of this tick, and the time when all were read, s.

    An input whose read took longer than `READ_S` is dropped.
    """
    telemetry = rig.link.poll(now_s)
    link_read_s = rig.clock.now_s()
    samples = rig.gyro.read(link_read_s)
    gyro_read_s = rig.clock.now_s()
    scan = rig.ranges.read(gyro_read_s)
    ranges_read_s = rig.clock.now_s()
    if link_read_s - now_s > READ_S:
        telemetry = replace(telemetry, odometry=None)
    if gyro_read_s - link_read_s > READ_S:
        samples = []
    if ranges_read_s - gyro_read_s > READ_S:
        scan = replace(scan, readings=dict.fromkeys(scan.readings, STALE))
    packets = rig.team.receive()
    return Inputs(telemetry, samples, scan, land, order, packets), ranges_read_s

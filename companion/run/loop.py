"""The control loop: carries inputs to the flight and its outputs away, 20 times a second.

The same loop serves the drone, SITL in two processes, and SITL in lockstep in one: what differs
is the clock, the link's transport and the bus, and those are handed in.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

from companion.app import App, Inputs, Outputs, Progress
from companion.core.messages import Order, RangeReading, RangeScan, RangeState
from companion.drivers.gyro import Gyro
from companion.link.link import Link
from companion.link.reports import Reports
from companion.pdps.flight.state import FlightState
from companion.run.clocks import Clock
from companion.safety.health.lateness import TICK_S

READ_S = 0.06
"""All of one kind is read in less; else the computer stood still, and when it was is not known."""

STALE = RangeReading(RangeState.STALE)

Record = Callable[[float, Inputs, Outputs], None]
"""Told of every tick when it is over."""


def record_nothing(now_s: float, inputs: Inputs, outputs: Outputs) -> None:
    """A flight that is not recorded."""


class Ranges(Protocol):
    """Every beam's sensor."""

    def read(self, time_s: float) -> RangeScan: ...


@dataclass(frozen=True, slots=True)
class Rig:
    """All that the flight touches outside itself."""

    link: Link
    ranges: Ranges
    gyro: Gyro
    clock: Clock
    reports: Reports


def fly(
    app: App,
    rig: Rig,
    watch: Callable[[Progress], None],
    land_requested: Callable[[], bool] = lambda: False,
    record: Record = record_nothing,
    *,
    orders: Callable[[], Order | None] = lambda: None,
) -> FlightState:
    """Fly until the flight has ended, one way or another; its last state."""
    now_s = rig.clock.wait_until(0.0)
    tick = 0
    while True:
        began_s = now_s
        inputs, now_s = _read(rig, began_s, land_requested(), orders())
        outputs = app.step(now_s, inputs)
        rig.link.send(now_s, outputs.setpoint, outputs.command, outputs.pose)
        flight = outputs.flight
        told = flight.activity, flight.trouble, flight.notice
        rig.link.transmit(rig.reports.due(now_s, outputs.scan, *told))
        record(now_s, inputs, outputs)
        watch(outputs.progress)
        if outputs.finished:
            return app.flight
        tick = max(tick + 1, int(began_s / TICK_S))
        now_s = rig.clock.wait_until(tick * TICK_S)


def _read(rig: Rig, now_s: float, land: bool, order: Order | None) -> tuple[Inputs, float]:
    """What has come, each with the time when it was read, and when all had been.

    What was being read while the computer stood still is left out.
    """
    telemetry = rig.link.poll(now_s)
    heard_s = rig.clock.now_s()
    samples = rig.gyro.read(heard_s)
    turned_s = rig.clock.now_s()
    scan = rig.ranges.read(turned_s)
    seen_s = rig.clock.now_s()
    if heard_s - now_s > READ_S:
        telemetry = replace(telemetry, odometry=None)
    if turned_s - heard_s > READ_S:
        samples = []
    if seen_s - turned_s > READ_S:
        scan = replace(scan, readings=dict.fromkeys(scan.readings, STALE))
    return Inputs(telemetry, samples, scan, land, order), seen_s

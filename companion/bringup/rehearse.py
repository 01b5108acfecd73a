"""Runs a rehearsal at the terminal: the folder, the sensors, the link, the pilot, the motors."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from companion.bringup.findings import CheckResult, Finding, table
from companion.bringup.rehearsal import Rehearsal
from companion.bringup.self_test import Examination
from companion.bringup.trial_recording import TrialRecording
from companion.config.settings import Config
from companion.core.errors import OutputError
from companion.drivers.wires.bus import Wires
from companion.drivers.wires.opening import open_bus
from companion.link.identity import AutopilotIdentity
from companion.link.link_budget import require_capacity
from companion.link.transports.open_link import open_transport
from companion.link.transports.transport import Transport
from companion.recording.room import needed_bytes, refuse_no_room
from companion.run.clocks import Clock, open_clock
from companion.run.preflight.bus_time import is_slow, slow_bus_remedy, sweep_time_s
from companion.run.preflight.rehearsed import forget, passed_now, store
from companion.safety.health.lateness import TICK_S, Lateness

PROPELLERS = (
    "The motors will turn. Take the propellers off, fasten the drone, and have the transmitter in "
    'hand with its throttle stick at the middle. Type "off" when the propellers are off: '
)
"""Question before the rehearsal."""
OFF = "off"
"""The only answer that begins it."""


def rehearse(config: Config, out: Path, console: Console) -> bool:
    """Rehearse the flight that `companion fly` would fly, and store the pass; True if passed.

    Raises:
        CompanionError: the link, the bus or the file of the pass cannot be used.
    """
    forget(config.preflight.rehearsal_file)
    require_capacity(config)
    folder = _folder(out, config)
    console.print(table([folder]))
    if folder.verdict is not CheckResult.GOOD or not _propellers_are_off(console):
        console.print("not rehearsed: no flight is allowed", soft_wrap=True)
        return False
    transport = open_transport(config.link, console.print)
    with (
        closing(transport),
        closing(open_bus(config.sensors.bus)) as wires,
        closing(open_clock(config, transport, console.print)) as clock,
    ):
        opened = Opened(config, transport, wires, clock, out)
        lines, autopilot = play(opened, _shown_on(console))
    bad = [line.part for line in lines if line.verdict is not CheckResult.GOOD]
    if bad or not autopilot:
        console.print(f"failed: {', '.join(bad)}; no flight is allowed", soft_wrap=True)
        return False
    seen = tuple(f"{line.part}: {line.seen}" for line in [folder, *lines])
    store(config.preflight.rehearsal_file, passed_now(config, autopilot, seen))
    _tell_passed(config, console)
    return True


def _tell_passed(config: Config, console: Console) -> None:
    preflight = config.preflight
    text = f"passed: flights are allowed for {preflight.rehearsal_days:g} days"
    console.print(f"{text}, by {preflight.rehearsal_file}", soft_wrap=True)
    if preflight.transmitter:
        console.print(
            "before the flight move the mode switch away and back: the autopilot is still in the "
            "companion's mode",
            soft_wrap=True,
        )


Show = Callable[[Sequence[Finding], str], None]
"""Shows new lines and the text for the pilot."""


@dataclass(frozen=True, slots=True)
class Opened:
    """What a rehearsal needs open."""

    config: Config
    transport: Transport
    wires: Wires
    clock: Clock
    out: Path


def play(opened: Opened, show: Show) -> tuple[list[Finding], str]:
    """Run the rehearsal; returns its lines and the identity of the autopilot."""
    config, clock = opened.config, opened.clock
    recording = TrialRecording(opened.out, config)
    identity = AutopilotIdentity(config.link.system_id)
    needs_pilot = config.preflight.transmitter and not config.sensors.is_simulated
    link, wires = recording.tap(opened.transport), opened.wires
    examination = Examination(config, link, wires, needs_pilot=needs_pilot, listeners=[identity])
    has_pilot = config.preflight.transmitter
    rehearsal = Rehearsal(examination, config.link.setpoint_loss_s, has_pilot=has_pilot)
    lateness, late = Lateness(), ""
    lines = [_bus(config, examination, clock)]
    show(lines, "")
    shown, prompt, due_s = 0, "", clock.wait_until(0.0)
    while not rehearsal.is_over:
        try:
            now_s = clock.wait_until(due_s)
            due_s = now_s + TICK_S
            lateness.tick(now_s)
            late = lateness.fault.text if lateness.fault else late
            rehearsal.step(now_s)
            examination.link.transmit(identity.requests(now_s))
            recording.tick(now_s, examination.telemetry, examination.readings)
        except KeyboardInterrupt:
            rehearsal.interrupt()
        if len(rehearsal.lines) > shown or rehearsal.prompt != prompt:
            show(rehearsal.lines[shown:], rehearsal.prompt)
            shown, prompt = len(rehearsal.lines), rehearsal.prompt
    last = [recording.finding(), _computer(late), _version(identity)]
    show(last, "")
    return [*lines, *rehearsal.lines, *last], identity.text


def _propellers_are_off(console: Console) -> bool:
    try:
        return console.input(PROPELLERS).strip().lower() == OFF
    except EOFError:
        console.print("a rehearsal needs a person at the terminal, and a pilot", soft_wrap=True)
        return False


def _shown_on(console: Console) -> Show:
    def show(lines: Sequence[Finding], prompt: str) -> None:
        if lines:
            rows = table(lines)
            rows.show_header = False
            console.print(rows)
        if prompt:
            console.print(f"[bold]>>> {prompt}[/]", soft_wrap=True)

    return show


def _folder(out: Path, config: Config) -> Finding:
    try:
        free = refuse_no_room(out, config)
    except OutputError as error:
        return Finding("folder", CheckResult.BAD, str(error), "nothing else was tried")
    seen = f"{out}: writable, {free / 1e6:.0f} MB free of {needed_bytes(config) / 1e6:.0f} needed"
    return Finding("folder", CheckResult.GOOD, seen)


def _bus(config: Config, examination: Examination, clock: Clock) -> Finding:
    sweep_s = sweep_time_s(examination.sweep, clock)
    seen = f"all sensors in {1000 * sweep_s:.0f} ms of {1000 * TICK_S:.0f} ms"
    if is_slow(sweep_s):
        return Finding("bus", CheckResult.BAD, seen, slow_bus_remedy(config.sensors.bus, sweep_s))
    return Finding("bus", CheckResult.GOOD, seen)


def _computer(late: str) -> Finding:
    if not late:
        return Finding("computer", CheckResult.GOOD, "every tick in time")
    remedy = "end other programs on it; check its cooling and its supply (vcgencmd get_throttled)"
    return Finding("computer", CheckResult.BAD, late, remedy)


def _version(identity: AutopilotIdentity) -> Finding:
    if identity.text:
        return Finding("version", CheckResult.GOOD, identity.text)
    remedy = "the pass belongs to one autopilot: check that the link passes AUTOPILOT_VERSION"
    return Finding("version", CheckResult.BAD, "not reported", remedy)

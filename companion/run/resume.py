"""Recovers a flight after a crash of this program.

    LISTEN ──armed, in our offboard mode──► HOLD ──"resume"──► the flight continues
      │                                       └────"land"────► the drone lands
      └──otherwise──► landed, or under other control: only the map is computed

LISTEN is in `commands/recover.py`, which loads nothing else first. Nothing here arms or takes off.
During HOLD, the flight is replayed from its recording, in part at each tick. A flight that crashed
before, or without a recent recording, lands.
"""

import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

from rich.console import Console

from companion.app import App
from companion.config.settings import Config
from companion.core.errors import CompanionError
from companion.core.messages import HOLD, GyroSample, RangeScan, is_ours
from companion.drivers.models import range_models
from companion.drivers.wires.opening import open_bus
from companion.export.map_files import save
from companion.link.link import Link
from companion.link.reports import Reports
from companion.link.transports.serial_transport import SerialTransport
from companion.link.transports.transport import UdpTransport
from companion.pdps.flight.ground import CONNECT_TIMEOUT_S
from companion.pdps.flight.state import FLYING_PHASES, FlightState, Phase
from companion.recording.crashed import Crashed
from companion.recording.reader import Recording, read
from companion.recording.recorder import open_recorder
from companion.recording.replay import replay
from companion.run.clocks import Clock, open_clock
from companion.run.console import summary
from companion.run.hardware import make_rig
from companion.run.loop import ControlLoop, Rig
from companion.run.systemd import Service
from companion.run.unattended import EXIT_ENDED, EXIT_FAILED, fly_to_the_end
from companion.safety.health.lateness import TICK_S
from companion.team.radio import NoRadio, TeamRadio, new_instance
from companion.team.zenoh_radio import open_team_radio

REPLAY_S = 0.04
"""Real time per tick for the replay, s. Chosen."""
CRASHED = "the companion had crashed"
"""Reported reason of the landing."""


class NoRanges:
    """Replacement for the range sensors, which are not needed to land."""

    def read(self, time_s: float) -> RangeScan:
        return RangeScan(time_s, {})


class NoGyro:
    """Replacement for the gyro, which is not needed to land."""

    def read(self, time_s: float) -> list[GyroSample]:
        return []


class Recovery:
    """Recovery of one flight; its methods return the exit status."""

    def __init__(
        self,
        settings: Config,
        transport: UdpTransport | SerialTransport,
        clock: Clock,
        *,
        crashed: Crashed | None,
        out: Path,
        console: Console,
    ) -> None:
        self._settings = settings
        self._transport = transport
        self._clock = clock
        self._crashed = crashed
        self._recording = _read(crashed, console)
        self._out = out
        self._console = console

    def take_up(self) -> int:
        """Resume the flight or land."""
        crashed, recording = self._crashed, self._recording
        asked = self._settings.mission.after_crash == "resume"
        if asked and crashed and crashed.is_fresh and recording and may_be_resumed(recording):
            try:
                return self._resume(crashed, recording)
            except Exception as error:  # any error: the drone is in the air
                self._console.print(f"cannot resume: {_reason(error)}")
        return self._land()

    def _resume(self, crashed: Crashed, recording: Recording) -> int:
        settings, tell = self._settings, self._console.print
        wires = open_bus(settings.sensors.bus)
        since_s = recording.ticks[-1].now_s + crashed.age_s
        clock = open_clock(settings, self._transport, tell, since_s)
        recorder = open_recorder(
            self._out,
            settings,
            time.time(),
            tell,
            continues=crashed.path.name,
            earlier=recording.earlier,
        )
        with ExitStack() as stack:
            radio = self._team_radio(stack)
            rig = make_rig(settings, recorder.tap(self._transport), wires, clock, radio)
            app = App(recording.config, recording.earlier, instance=new_instance())
            if not hold(rig.link, clock, replayed(recording, app)):
                return self.map_only()
            if app.estimator is None or app.flight.phase not in FLYING_PHASES:
                return self._land()
            return fly_to_the_end(app, rig, recorder, out=self._out, console=self._console)

    def _team_radio(self, stack: ExitStack) -> TeamRadio:
        """The radio of a team; without one the drone flies on alone."""
        try:
            return stack.enter_context(open_team_radio(self._settings.team))
        except CompanionError as error:
            self._console.print(f"the team cannot be heard: {error}", soft_wrap=True)
            return NoRadio()

    def _land(self) -> int:
        """Land with a flight that only lands; the map is computed from the recording."""
        settings, clock = self._settings, self._clock
        link = Link(self._transport, settings.link)
        if not hold(link, clock, iter(())):
            return self.map_only()
        reports = Reports(settings.link, range_models(settings.sensors))
        rig = Rig(link, NoRanges(), NoGyro(), clock, reports)
        now_s = clock.wait_until(0.0)
        app = App(settings)
        app.flight = FlightState(Phase.LAND, now_s, began_s=now_s, trouble=CRASHED)
        service = Service()
        ControlLoop(app, rig, lambda progress: service.alive(progress.activity)).run()
        self._console.print(app.flight.ending)
        if app.flight.phase is Phase.FAILED:
            return EXIT_FAILED  # it may be in the air: systemd tries again
        return self.map_only()

    def map_only(self) -> int:
        """Compute only the map: the drone has landed, or is under other control."""
        service = Service()
        service.alive("making the map")  # for systemd, an exit before READY is a failure
        service.landed()
        if self._recording is None:
            self._console.print("nothing to recover")
            return 0
        try:
            app = replay(self._recording)
            plan = app.final_floor_plan()
            files = save(plan, self._out, app.flight.unfinished)
            self._console.print(summary(app.flight, plan, files, None))
        except Exception as error:  # another attempt would not help: no flight to save
            self._console.print(f"the map is not saved: {_reason(error)}", soft_wrap=True)
            return EXIT_ENDED
        return 0


def _reason(error: Exception) -> str:
    return str(error) if isinstance(error, CompanionError) else repr(error)


def may_be_resumed(recording: Recording) -> bool:
    """True if the recording has ticks and is not itself of a resumed flight."""
    return bool(recording.ticks and not recording.continues)


def _read(crashed: Crashed | None, console: Console) -> Recording | None:
    try:
        return read(crashed.path) if crashed else None
    except Exception as error:  # a truncated file or a failed disk: land without it
        console.print(f"the recording cannot be used: {_reason(error)}")
        return None


def replayed(recording: Recording, app: App) -> Iterator[None]:
    """Replay the flight into `app`; yields after each `REPLAY_S` of real time."""
    began_s = time.monotonic()
    for tick in recording.ticks:
        app.step(tick.now_s, tick.inputs)
        if time.monotonic() - began_s > REPLAY_S:
            yield
            began_s = time.monotonic()


def hold(link: Link, clock: Clock, work: Iterator[None]) -> bool:
    """Hold the position until the work is done and the autopilot's mode is known.

    Without a known mode, the wait ends after `CONNECT_TIMEOUT_S`. Returns False as soon as
    the drone is not under our control.
    """
    now_s = clock.wait_until(0.0)
    known_by_s = now_s + CONNECT_TIMEOUT_S
    is_done = False
    while True:
        vehicle = link.poll(now_s).vehicle
        is_known = bool(vehicle.mode) and vehicle.is_mode_recent
        if is_known and (vehicle.left_offboard or not is_ours(vehicle)):
            return False
        if is_done and (is_known or now_s > known_by_s):
            return True
        link.send(now_s, HOLD, None)
        is_done = is_done or _is_over(work)
        now_s = clock.wait_until(now_s + TICK_S)


def _is_over(work: Iterator[None]) -> bool:
    """Do one more part of the work; returns True at its end."""
    for _ in work:
        return False
    return True

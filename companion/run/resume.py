"""The way back into a flight after a crash of this program.

    LISTEN ──armed, in the mode that we asked for──► HOLD ──"resume"──► the flight goes on
      │                                               └────"land"─────► it lands
      └──otherwise──► it has landed, or is somebody else's: only the map is made

LISTEN is in `commands/recover.py`, which loads nothing else before. Nothing here arms or takes off.
While it holds, the flight is replayed from its recording, a piece at a tick; a flight that had
crashed before, or has no fresh recording, lands.
"""

import time
from collections.abc import Iterator
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
from companion.run.loop import Rig, fly
from companion.run.systemd import Service
from companion.run.unattended import EXIT_ENDED, EXIT_FAILED, fly_to_the_end
from companion.safety.health.lateness import TICK_S

REPLAY_S = 0.04
"""Of each tick, by the clock on the wall."""
CRASHED = "the companion had crashed"


class NoRanges:
    """Stands for sensors that are not needed to land."""

    def read(self, time_s: float) -> RangeScan:
        return RangeScan(time_s, {})


class NoGyro:
    """The same."""

    def read(self, time_s: float) -> list[GyroSample]:
        return []


class Recovery:
    """Of one flight; each way returns the exit status."""

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
        """Go on, or land."""
        crashed, recording = self._crashed, self._recording
        asked = self._settings.mission.after_crash == "resume"
        if asked and crashed and crashed.is_fresh and recording and may_be_resumed(recording):
            try:
                return self._resume(crashed, recording)
            except Exception as error:  # whatever it is: the drone is in the air
                self._console.print(f"cannot go on: {_reason(error)}")
        return self._land()

    def _resume(self, crashed: Crashed, recording: Recording) -> int:
        settings, tell = self._settings, self._console.print
        wires = open_bus(settings.sensors.bus)
        since_s = recording.ticks[-1].now_s + crashed.age_s
        clock = open_clock(settings, self._transport, tell, since_s)
        recorder = open_recorder(
            self._out, settings, time.time(), tell, continues=crashed.path.name
        )
        rig = make_rig(settings, recorder.tap(self._transport), wires, clock)
        app = App(recording.config)
        if not hold(rig.link, clock, replayed(recording, app)):
            return self.map_only()
        if app.estimator is None or app.flight.phase not in FLYING_PHASES:
            return self._land()
        return fly_to_the_end(app, rig, recorder, out=self._out, console=self._console)

    def _land(self) -> int:
        """By a flight that does nothing else; the map is that of the recording."""
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
        fly(app, rig, lambda progress: service.alive(progress.activity))
        self._console.print(app.flight.ending)
        if app.flight.phase is Phase.FAILED:
            return EXIT_FAILED  # it may be in the air: to be tried again
        return self.map_only()

    def map_only(self) -> int:
        """It has landed, or is somebody else's."""
        service = Service()
        service.alive("making the map")  # who ends before it was ready has failed, for systemd
        service.landed()
        if self._recording is None:
            self._console.print("nothing to recover")
            return 0
        try:
            app = replay(self._recording)
            plan = app.final_floor_plan()
            self._console.print(summary(app.flight, plan, save(plan, self._out), None))
        except Exception as error:  # nothing is in the air that another attempt would help
            self._console.print(f"the map is not saved: {_reason(error)}", soft_wrap=True)
            return EXIT_ENDED
        return 0


def _reason(error: Exception) -> str:
    return str(error) if isinstance(error, CompanionError) else repr(error)


def may_be_resumed(recording: Recording) -> bool:
    """There is something in it, and it is not what has crashed again after a crash."""
    return bool(recording.ticks) and not recording.continues


def _read(crashed: Crashed | None, console: Console) -> Recording | None:
    try:
        return read(crashed.path) if crashed else None
    except Exception as error:  # a torn file, or a disk that does not answer: it lands without
        console.print(f"the recording cannot be used: {_reason(error)}")
        return None


def replayed(recording: Recording, app: App) -> Iterator[None]:
    """The flight once more; a pause whenever a tick's share of time is used up."""
    began_s = time.monotonic()
    for tick in recording.ticks:
        app.step(tick.now_s, tick.inputs)
        if time.monotonic() - began_s > REPLAY_S:
            yield
            began_s = time.monotonic()


def hold(link: Link, clock: Clock, work: Iterator[None]) -> bool:
    """Stay where it is until the work is done and the autopilot is known; False: not ours."""
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
    """After one more piece of it."""
    for _ in work:
        return False
    return True

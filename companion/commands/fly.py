"""The command that flies, and the one place where the flight's parts are put together."""

import signal
import time
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.app import App, Inputs, Outputs, Progress
from companion.commands.options import (
    BusUrl,
    ConfigFile,
    LinkUrl,
    MissionSet,
    Profile,
    load_settings,
)
from companion.config.settings import Config
from companion.core.errors import CompanionError
from companion.core.messages import FloorPlan
from companion.core.printed import flight_console
from companion.export.map_files import AutoSave, save
from companion.pdps.flight_phases import Flight, Phase
from companion.recording.recorder import Recorder
from companion.run.console import ProgressLine, summary
from companion.run.hardware import open_rig
from companion.run.loop import Record, Rig, fly, record_nothing
from companion.run.systemd import Service
from companion.view.feed import open_feed

EXIT_FAILED = 1
"""As of any program that breaks off: whoever started it has the drone taken up again."""
EXIT_ENDED = 3
"""It has landed, or the pilot has it, but the mission is not complete or its map not saved: nobody
else is to touch it."""

commands = typer.Typer()


@commands.command("fly")
def fly_command(
    config: ConfigFile = None,
    link: LinkUrl = None,
    bus: BusUrl = None,
    profile: Profile = None,
    mission: Annotated[str | None, typer.Option(help="room, building, exterior, layers.")] = None,
    mission_set: MissionSet = None,
    out: Annotated[Path, typer.Option(help="Folder for the map.")] = Path("out"),
) -> None:
    """Take off, scan, return, land; leave map.png, map.ply and map.json."""
    settings = load_settings(
        config, link, bus, profile, mission=mission, mission_set=mission_set or ()
    )
    with flight_console() as console:
        code = _fly(settings, out, console)
    raise typer.Exit(code)


def _fly(settings: Config, out: Path, console: Console) -> int:
    app = App(settings)
    with (
        open_rig(settings, out, console.print) as (rig, recorder),
        closing(open_feed(settings, app, console.print)) as feed,
    ):
        console.print(f"autopilot at {settings.link.url}, sensors on {settings.sensors.bus}")
        try:
            code = fly_to_the_end(app, rig, recorder, out, console, feed.tick)
        except CompanionError as error:  # only what is not begun is refused
            console.print(f"companion: {error}", soft_wrap=True)
            return EXIT_FAILED
    if not app.flight.took_off:
        console.print(_remedy(settings), soft_wrap=True)
    return code


def fly_to_the_end(
    app: App,
    rig: Rig,
    recorder: Recorder,
    out: Path,
    console: Console,
    look_on: Record = record_nothing,
) -> int:
    """Fly, and leave the map; the exit status.

    An error leaves the map so far and the recording as they are, without delay, so that `companion
    recover` can go on with them.
    """
    autosave = AutoSave(out, app.floor_plan, console.print)
    service = Service()
    interrupted = _Interruption(console)
    began_s = time.monotonic()
    try:
        with ProgressLine(console) as line:

            def watch(progress: Progress) -> None:
                service.alive(progress.activity)
                line.show(progress)
                autosave.update(progress.time_s)

            def record(now_s: float, inputs: Inputs, outputs: Outputs) -> None:
                recorder.tick(now_s, inputs, outputs)
                look_on(now_s, inputs, outputs)

            fly(app, rig, watch, interrupted.requested, record)
    except KeyboardInterrupt:
        _leave(app, recorder, out, service, autosave, console)
        raise
    except Exception:
        autosave.save_at_once()
        raise
    plan, files = _leave(app, recorder, out, service, autosave, console)
    console.print(summary(app.flight, plan, files, time.monotonic() - began_s))
    return exit_status(app.flight) if files else exit_status(app.flight) or EXIT_ENDED


def exit_status(flight: Flight) -> int:
    """Of a flight that has ended; systemd's units go by it."""
    if flight.completed:
        return 0
    is_broken_off = flight.phase is Phase.FAILED and not flight.is_others
    return EXIT_FAILED if is_broken_off else EXIT_ENDED


def _leave(
    app: App, recorder: Recorder, out: Path, service: Service, autosave: AutoSave, console: Console
) -> tuple[FloorPlan, list[Path]]:
    """The map and its files; none if they cannot be written, which the drone in the air ignores."""
    service.landed()
    autosave.settle()
    plan = FloorPlan()
    try:
        plan = app.final_floor_plan()
        recorder.close(plan)
        return plan, save(plan, out)
    except Exception as error:  # the flight is over, one way or another, and keeps its status
        reason = error if isinstance(error, CompanionError) else repr(error)
        console.print(f"the map is not saved: {reason}", soft_wrap=True)
        return plan, []


def _remedy(settings: Config) -> str:
    return (
        f"tried the autopilot at {settings.link.url} and sensors on {settings.sensors.bus}; "
        "on a laptop start the simulator first: sitl run room_100"
    )


class _Interruption:
    """Ctrl-C or a stop of the service asks for landing; the second Ctrl-C ends the flight here."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._requested = False
        signal.signal(signal.SIGINT, self._request)
        signal.signal(signal.SIGTERM, self._request)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # the flight does not need its terminal

    def _request(self, number: int, frame: object) -> None:
        if self._requested and number == signal.SIGINT:
            raise KeyboardInterrupt
        self._requested = True
        self._console.print("landing; press Ctrl-C again to leave the drone to the autopilot")

    def requested(self) -> bool:
        return self._requested

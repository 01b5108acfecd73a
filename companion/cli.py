"""The commands on the drone, and the one place where the flight's parts are put together."""

import signal
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion import afterwards
from companion.app import App, Inputs, Outputs, Progress
from companion.calibrate_cli import commands as calibrate_commands
from companion.check_cli import check
from companion.config import Config
from companion.console import ProgressLine, summary
from companion.errors import CompanionError, OutputError
from companion.fly import Rig, fly
from companion.mapping.files import AutoSave, save
from companion.offline import sensors as log_sensors
from companion.offline.console import LogProgress, log_summary
from companion.offline.files import save_results
from companion.offline.mapper import map_log
from companion.offline.readers import read_log
from companion.options import BusUrl, ConfigFile, LinkUrl, Profile, load_settings
from companion.recording.recorder import Recorder
from companion.rig import open_rig
from companion.service import Service
from companion.view.cli import view
from companion.view.feed import open_feed

EXIT_NOT_COMPLETED = 1
EXIT_REFUSED = 2

commands = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Fly a drone through rooms it has never seen and bring back the map; or map a log.",
)
commands.add_typer(afterwards.commands)
commands.command()(check)
commands.add_typer(calibrate_commands, name="calibrate")
commands.command()(view)


@commands.command("fly")
def fly_command(
    config: ConfigFile = None,
    link: LinkUrl = None,
    bus: BusUrl = None,
    profile: Profile = None,
    mission: Annotated[str | None, typer.Option(help="room, building, exterior, layers.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for the map.")] = Path("out"),
) -> None:
    """Take off, scan, return, land; leave map.png, map.ply and map.json."""
    settings = load_settings(config, link, bus, profile, mission=mission)
    raise typer.Exit(_fly(settings, out))


@commands.command("map")
def map_command(
    log: Annotated[Path, typer.Argument(help="CSV file; see docs/offline.md.")],
    config: Annotated[
        Path | None, typer.Option(help="TOML file of the sensors; else LOG's name with .toml.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the map.")] = Path("out"),
) -> None:
    """Make the map of a recorded log: map.png, map.ply, map.json, trajectory.tum, report.json."""
    console = Console(highlight=False)
    sensors = log_sensors.load(config, log)
    with LogProgress(console) as progress:
        result = map_log(read_log(log, progress.show), sensors, progress.show)
    try:
        files = save_results(result, out)
    except OSError as error:
        raise OutputError(f"{error.filename or out}: {error.strerror}") from error
    console.print(log_summary(result, files))


def _fly(settings: Config, out: Path) -> int:
    console = Console(highlight=False)
    with open_rig(settings, out, console.print) as (rig, recorder):
        console.print(f"autopilot at {settings.link.url}, sensors on {settings.sensors.bus}")
        return _fly_with(rig, recorder, settings, out, console)


def _fly_with(rig: Rig, recorder: Recorder, settings: Config, out: Path, console: Console) -> int:
    app = App(settings)
    feed = open_feed(settings, app, console.print)
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
                feed.tick(now_s, inputs, outputs)

            flight = fly(app, rig, watch, interrupted.requested, record)
    finally:
        service.landed()
        feed.close()
        plan = app.final_floor_plan()
        recorder.close(plan)
        files = save(plan, out)
    console.print(summary(flight, plan, files, time.monotonic() - began_s))
    if not flight.took_off:
        console.print(_remedy(settings), soft_wrap=True)
    return 0 if flight.completed else EXIT_NOT_COMPLETED


def _remedy(settings: Config) -> str:
    return (
        f"tried the autopilot at {settings.link.url} and sensors on {settings.sensors.bus}; "
        "on a laptop start the simulator first: sitl run room_100"
    )


class _Interruption:
    """Ctrl-C or a stop of the service asks for landing; the second Ctrl-C ends the program."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._requested = False
        signal.signal(signal.SIGINT, self._request)
        signal.signal(signal.SIGTERM, self._request)

    def _request(self, number: int, frame: object) -> None:
        if self._requested and number == signal.SIGINT:
            raise KeyboardInterrupt
        self._requested = True
        self._console.print("landing; press Ctrl-C again to leave the drone to the autopilot")

    def requested(self) -> bool:
        return self._requested


def main() -> None:
    """Run a command; anything refused is one line on stderr and exit status 2."""
    try:
        commands()
    except CompanionError as error:
        # what is told may look like the console's markup
        console = Console(stderr=True, highlight=False, markup=False)
        console.print(f"companion: {error}", soft_wrap=True)
        raise SystemExit(EXIT_REFUSED) from None

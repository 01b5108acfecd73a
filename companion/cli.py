"""The commands on the drone, and the one place where the flight's parts are put together."""

import signal
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion import config as configuration
from companion.app import App, Progress
from companion.clocks import SitlClock, SystemClock
from companion.config import Config
from companion.console import ProgressLine, summary
from companion.drivers.bus import open_bus
from companion.drivers.lsm9ds1 import Lsm9ds1
from companion.drivers.ranges import RangeSensors
from companion.drivers.served_bus import VirtualClock
from companion.errors import CompanionError
from companion.fly import Clock, Rig, fly
from companion.link.link import Link
from companion.link.transport import UdpTransport
from companion.mapping.files import AutoSave, save

EXIT_NOT_COMPLETED = 1
EXIT_REFUSED = 2

commands = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Fly a drone through rooms it has never seen and bring back the map.",
)


@commands.callback()
def _several_commands() -> None:
    """Keep `fly` a command of its own."""


@commands.command("fly")
def fly_command(
    config: Annotated[Path | None, typer.Option(help="TOML file; see docs/config.md.")] = None,
    link: Annotated[str | None, typer.Option(help="udpin:HOST:PORT or udpout:HOST:PORT.")] = None,
    bus: Annotated[str | None, typer.Option(help="/dev/i2c-N or sitl://HOST:PORT.")] = None,
    profile: Annotated[str | None, typer.Option(help="Range sensors: gp2y0a710k0f, paper.")] = None,
    mission: Annotated[str | None, typer.Option(help="room, building, exterior, layers.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for the map.")] = Path("out"),
) -> None:
    """Take off, scan, return, land; leave map.png, map.ply and map.json."""
    overrides = {
        "link.url": link,
        "sensors.bus": bus,
        "sensors.profile": profile,
        "mission.kind": mission,
    }
    settings = configuration.load(config, {k: v for k, v in overrides.items() if v is not None})
    raise typer.Exit(_fly(settings, out))


def _fly(settings: Config, out: Path) -> int:
    console = Console(highlight=False)
    transport = UdpTransport(settings.link.url, settings.link.system_id, settings.link.component_id)
    bus = open_bus(settings.sensors.bus)
    console.print(f"autopilot at {settings.link.url}, sensors on {settings.sensors.bus}")
    rig = Rig(
        Link(transport, settings.link),
        RangeSensors(bus, settings.sensors),
        Lsm9ds1(bus, settings.sensors.gyro_address),
        _clock(settings, transport, console),
    )
    app = App(settings)
    autosave = AutoSave(out, app.floor_plan)
    interrupted = _Interruption(console)
    began_s = time.monotonic()
    try:
        with ProgressLine(console) as line:

            def watch(progress: Progress) -> None:
                line.show(progress)
                autosave.update(progress.time_s)

            flight = fly(app, rig, watch, interrupted.requested)
    finally:
        plan = app.final_floor_plan()
        files = save(plan, out)
    console.print(summary(flight, plan, files, time.monotonic() - began_s))
    if not flight.took_off:
        console.print(_remedy(settings), soft_wrap=True)
    return 0 if flight.completed else EXIT_NOT_COMPLETED


def _clock(settings: Config, transport: UdpTransport, console: Console) -> Clock:
    if not settings.sensors.bus.startswith("sitl://"):
        return SystemClock()
    host, port = settings.sensors.bus.removeprefix("sitl://").rsplit(":", 1)
    return SitlClock(VirtualClock(host, int(port)), transport, console.print)


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
        Console(stderr=True, highlight=False).print(f"companion: {error}", soft_wrap=True)
        raise SystemExit(EXIT_REFUSED) from None

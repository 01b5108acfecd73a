"""Flies a mission: `companion fly`; the only place that assembles the parts of a flight."""

from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.app import App
from companion.commands.options import (
    BusUrl,
    ConfigFile,
    LinkUrl,
    MissionSet,
    Profile,
    load_settings,
)
from companion.config.settings import MISSION_KINDS, Config
from companion.core.errors import CompanionError
from companion.core.printed import flight_console
from companion.run.hardware import open_rig
from companion.run.unattended import EXIT_FAILED, fly_to_the_end
from companion.view.feed import open_feed

commands = typer.Typer()


@commands.command("fly")
def fly_command(
    config: ConfigFile = None,
    link: LinkUrl = None,
    bus: BusUrl = None,
    profile: Profile = None,
    mission: Annotated[str | None, typer.Option(help=f"{', '.join(MISSION_KINDS)}.")] = None,
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
            code = fly_to_the_end(app, rig, recorder, out=out, console=console, look_on=feed.tick)
        except CompanionError as error:  # exit status 2 is for errors before this point
            console.print(f"companion: {error}", soft_wrap=True)
            return EXIT_FAILED
    if not app.flight.took_off:
        console.print(_remedy(settings), soft_wrap=True)
    return code


def _remedy(settings: Config) -> str:
    return (
        f"tried the autopilot at {settings.link.url} and sensors on {settings.sensors.bus}; "
        "on a laptop start the simulator first: sitl run room_100"
    )

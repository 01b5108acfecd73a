"""Flies a mission: `companion fly`; the only place that assembles the parts of a flight."""

from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.app import App
from companion.bringup.rehearse import rehearse
from companion.commands.options import (
    BusUrl,
    ConfigFile,
    Foxglove,
    LinkUrl,
    MissionSet,
    Profile,
    WithFoxglove,
    load_settings,
)
from companion.config.settings import MISSION_KINDS, Config
from companion.core.errors import CompanionError, ConfigError
from companion.core.printed import flight_console
from companion.earlier import EarlierFlights
from companion.run.freed_memory import return_freed_memory
from companion.run.hardware import open_rig
from companion.run.unattended import EXIT_FAILED, fly_to_the_end
from companion.team.radio import new_instance
from companion.view.feed import open_feed
from companion.view.foxglove_live import publish_too

commands = typer.Typer()


@commands.command("fly", cls=WithFoxglove)
def fly_command(
    config: ConfigFile = None,
    link: LinkUrl = None,
    bus: BusUrl = None,
    profile: Profile = None,
    mission: Annotated[str | None, typer.Option(help=f"{', '.join(MISSION_KINDS)}.")] = None,
    mission_set: MissionSet = None,
    out: Annotated[Path, typer.Option(help="Folder for the map.")] = Path("out"),
    survey: Annotated[
        Path | None,
        typer.Option(help="Folder of a survey: fly what is not mapped yet; see docs/surveys.md."),
    ] = None,
    is_rehearsal: Annotated[
        bool, typer.Option("--rehearse", help="With the propellers off, try all but the flight.")
    ] = False,
    skip_rehearsal: Annotated[
        bool, typer.Option("--skip-rehearsal", help="Fly a real drone that was not rehearsed.")
    ] = False,
    foxglove: Foxglove = None,
) -> None:
    """Take off, scan, return, land; leave map.png, map.ply and map.json."""
    return_freed_memory()
    settings = load_settings(
        config,
        link,
        bus,
        profile,
        mission=mission,
        mission_set=mission_set or (),
        foxglove=foxglove,
    )
    if is_rehearsal:
        passed = rehearse(settings, survey or out, Console(highlight=False))
        raise typer.Exit(0 if passed else EXIT_FAILED)
    with flight_console() as console:
        if survey is None:
            app = App(settings, instance=new_instance())
            code = _fly(app, settings, out, console, skip_rehearsal=skip_rehearsal)
        else:
            code = _fly_on(settings, survey, console, skip_rehearsal=skip_rehearsal)
    raise typer.Exit(code)


def _fly_on(settings: Config, folder: Path, console: Console, *, skip_rehearsal: bool) -> int:
    """Fly one flight of a survey, then make the joint map."""
    from companion.survey.folder import Survey  # noqa: PLC0415 - not for a single flight
    from companion.survey.left import left_to_fly  # noqa: PLC0415

    _refuse_not_recorded(settings, folder)
    survey = Survey(folder, console.print, settings.team)
    earlier = survey.earlier()
    if earlier is not None:
        console.print(left_to_fly(earlier, settings).in_words())
    app = App(settings, earlier, instance=new_instance())
    code = _fly(
        app,
        settings,
        folder / "last_flight",
        console,
        earlier=earlier,
        recordings=folder,
        skip_rehearsal=skip_rehearsal,
    )
    if app.flight.is_to_be_continued:
        console.print(f"to be continued: {app.flight.ending}", soft_wrap=True)
    if code == EXIT_FAILED:
        return code  # the recovery needs the computer
    try:
        if joint := survey.make_map():
            console.print(left_to_fly(joint.earlier, settings).in_words())
    except CompanionError as error:  # the flight is over and keeps its status
        console.print(f"the joint map is not made: {error}", soft_wrap=True)
    return code


def _refuse_not_recorded(settings: Config, folder: Path) -> None:
    """Refuse a survey without recordings.

    Raises:
        ConfigError: recordings are off.
    """
    if not settings.recording.enabled:
        raise ConfigError(
            f"recording.enabled = false: the survey {folder} is made of recordings; set it to true"
        )


def _fly(
    app: App,
    settings: Config,
    out: Path,
    console: Console,
    *,
    earlier: EarlierFlights | None = None,
    recordings: Path | None = None,
    skip_rehearsal: bool = False,
) -> int:
    """Fly, and write the map to `out`; recordings go there, too, or to another folder."""
    folder = recordings or out
    with (
        open_rig(settings, folder, console.print, earlier, skip_rehearsal=skip_rehearsal) as opened,
        closing(open_feed(settings, app, console.print)) as feed,
    ):
        rig, recorder = opened
        published = publish_too(recorder, settings, partial(console.print, soft_wrap=True))
        console.print(f"autopilot at {settings.link.url}, sensors on {settings.sensors.bus}")
        try:
            code = fly_to_the_end(app, rig, published, out=out, console=console, look_on=feed.tick)
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

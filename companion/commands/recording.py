"""Processes recordings: `companion replay`, `export` and `report`; runs on a laptop."""

from dataclasses import replace
from datetime import UTC, datetime
from enum import StrEnum
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from companion.core.errors import RecordingError
from companion.core.extras import needs_extra
from companion.core.frames import Place
from companion.core.messages import FloorPlan
from companion.core.textfile import has_control_character
from companion.export.plan.drawing import Contents
from companion.export.plan.labels import Labels
from companion.export.plan.room_names import read_room_names
from companion.export.plan.turned import Up
from companion.pdps.flight.state import Phase
from companion.run.console import summary

if TYPE_CHECKING:
    from companion.recording.reader import Recording

EXIT_OTHER_MAP = 1
"""Exit status if the replayed map differs from the recorded one. Chosen."""

commands = typer.Typer()
File = Annotated[Path, typer.Argument(metavar="FLIGHT.mcap", help="Recording of a flight.")]
Format = StrEnum(
    "Format", ["dxf", "svg", "pdf", "ifc", "pgm", "ply", "pcd", "glb", "bt", "geojson", "json"]
)


@commands.command("replay")
def replay_command(
    flight: File,
    out: Annotated[Path | None, typer.Option(help="Folder for the map.")] = None,
) -> None:
    """Replay a recording; exit status 1 if the map differs from the recorded one in any bit."""
    from companion.export.map_files import save  # noqa: PLC0415 - not for the drone
    from companion.recording.reader import read  # noqa: PLC0415
    from companion.recording.replay import is_same_map, replay  # noqa: PLC0415

    console = Console(highlight=False, markup=False)
    recording = read(flight)
    app = replay(recording)
    plan = app.final_floor_plan()
    files = save(plan, out, app.flight.unfinished) if out else []
    console.print(summary(app.flight, plan, files, None))
    same = is_same_map(app, recording)
    if same is None:
        console.print(
            f"the recording was cut short at {_end_s(recording):.1f} s: it contains no map"
        )
    elif same:
        console.print("the map equals the recorded map, to the bit")
    else:
        console.print(
            f"the map differs from the recorded map of companion {recording.companion_version}"
        )
        raise typer.Exit(EXIT_OTHER_MAP)


@commands.command("export")
def export_command(
    flight: File,
    format_: Annotated[
        list[Format], typer.Option("--format", help="Repeatable; each writes one or two files.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the files.")] = Path("out"),
    lat_deg: Annotated[
        float | None,
        typer.Option(
            min=-90,
            max=90,
            help="Latitude of take-off, °, for geojson and ifc; default: as configured.",
        ),
    ] = None,
    lon_deg: Annotated[
        float | None,
        typer.Option(
            min=-180,
            max=180,
            help="Longitude of take-off, °, for geojson and ifc; default: as configured.",
        ),
    ] = None,
    heading_deg: Annotated[
        float | None,
        typer.Option(
            min=-360,
            max=360,
            help="True heading at take-off, °, for geojson, ifc and --up north; default 0.",
        ),
    ] = None,
    title: Annotated[
        str | None, typer.Option(help="Title of the sheet; default: when it was flown.")
    ] = None,
    up: Annotated[Up, typer.Option(help="What is up on dxf, svg, pdf and ifc.")] = Up.WALLS,
    rooms: Annotated[
        Path | None, typer.Option(help='TOML file with names of rooms: "room 1" = "Kitchen".')
    ] = None,
    path: Annotated[bool, typer.Option(help="Draw the path flown.")] = True,
    points: Annotated[bool, typer.Option(help="Draw the ends of the beams.")] = True,
) -> None:
    """Write the map in other formats; see docs/exports.md."""
    from companion.recording.reader import read  # noqa: PLC0415 - not for the drone

    if title and has_control_character(title):
        raise typer.BadParameter(f"--title {title!r} contains a control character; remove it")
    recording = read(flight)
    link = recording.config.link
    heading_rad = None if heading_deg is None else radians(heading_deg)
    place = link.place
    if lat_deg is not None and lon_deg is not None:
        place = Place(lat_deg, lon_deg)
    elif lat_deg is not None or lon_deg is not None:
        raise typer.BadParameter("a place needs both --lat-deg and --lon-deg")
    if place:
        place = replace(place, heading_rad=heading_rad or 0.0)
    if up is Up.NORTH and heading_deg is None:
        raise typer.BadParameter("--up north needs the true heading at take-off, --heading-deg")
    with needs_extra("export"):
        from companion.export.formats import export  # noqa: PLC0415
        from companion.export.plan.survey import survey  # noqa: PLC0415

        found = survey(_plan(recording))
        known = [room.name for room in found.rooms]
        contents = Contents(path, points, read_room_names(rooms, known) if rooms else {})
        shown_title = f"{title}, {_date(recording)}" if title else _title(recording)
        labels = Labels(shown_title, place, heading_rad, _unfinished(recording), up, contents)
        names = [name.value for name in format_]
        export(found, names, out, flight.stem, labels, tell=print)


@commands.command("report")
def report_command(
    flight: File,
    out: Annotated[
        Path | None, typer.Option(help="HTML file; default: the recording's name with .html.")
    ] = None,
) -> None:
    """Write a report of the flight as one HTML page."""
    from companion.recording.reader import read  # noqa: PLC0415 - not for the drone

    recording = read(flight)
    path = out or flight.with_suffix(".html")
    with needs_extra("export"):
        from companion.report.page import write_report  # noqa: PLC0415

        write_report(recording, _plan(recording), _title(recording), path)
    print(path)


def _plan(recording: "Recording") -> FloorPlan:
    """The recorded map, or the map from a replay if the recording was cut short."""
    from companion.recording.replay import replay  # noqa: PLC0415 - not for the drone

    return recording.plan or replay(recording).final_floor_plan()


def _title(recording: "Recording") -> str:
    began = datetime.fromtimestamp(recording.began_unix_s, UTC)
    return f"Flight of {began:%Y-%m-%d %H:%M} UTC"


def _date(recording: "Recording") -> str:
    return f"{datetime.fromtimestamp(recording.began_unix_s, UTC):%Y-%m-%d}"


def _unfinished(recording: "Recording") -> str:
    """Why the mission was not completed; empty if it was."""
    ended = recording.phases[-1] if recording.phases else None
    if ended is None or ended.phase != Phase.DONE.name:
        return "the recording ends in flight"
    return ended.trouble


def _end_s(recording: "Recording") -> float:
    if not recording.ticks:
        raise RecordingError(f"{recording.path}: the recording ends before the flight begins")
    return recording.ticks[-1].now_s

"""The commands that look at a recording: replay, export, report. They belong on a laptop."""

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
from companion.run.console import summary

if TYPE_CHECKING:
    from companion.recording.reader import Recording

EXIT_OTHER_MAP = 1

commands = typer.Typer()
File = Annotated[Path, typer.Argument(metavar="FLIGHT.mcap", help="A flight's recording.")]
Format = StrEnum(
    "Format", ["dxf", "svg", "pdf", "pgm", "ply", "pcd", "glb", "bt", "geojson", "json"]
)


@commands.command("replay")
def replay_command(
    flight: File,
    out: Annotated[Path | None, typer.Option(help="Folder for the map.")] = None,
) -> None:
    """Fly a recording once more; exit status 1 if the map is not the flight's own, to the bit."""
    from companion.export.map_files import save  # noqa: PLC0415 - not for the drone
    from companion.recording.reader import read  # noqa: PLC0415
    from companion.recording.replay import is_same_map, replay  # noqa: PLC0415

    console = Console(highlight=False, markup=False)
    recording = read(flight)
    app = replay(recording)
    plan = app.final_floor_plan()
    console.print(summary(app.flight, plan, save(plan, out) if out else [], None))
    same = is_same_map(app, recording)
    if same is None:
        console.print(
            f"the recording was cut short at {_end_s(recording):.1f} s: no map of its own"
        )
    elif same:
        console.print("the map is the flight's own, to the bit")
    else:
        console.print(
            f"the map is not the flight's own, which companion {recording.companion_version} made"
        )
        raise typer.Exit(EXIT_OTHER_MAP)


@commands.command("export")
def export_command(
    flight: File,
    format_: Annotated[
        list[Format], typer.Option("--format", help="Repeatable: one file, or two, for each.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the files.")] = Path("out"),
    lat_deg: Annotated[
        float | None, typer.Option(help="Where it took off, for geojson; else link.origin_lat_deg.")
    ] = None,
    lon_deg: Annotated[float | None, typer.Option(help="As --lat-deg.")] = None,
    heading_deg: Annotated[
        float, typer.Option(help="True heading at take-off, for geojson.")
    ] = 0.0,
) -> None:
    """Write the map in the formats of other programs; docs/exports.md describes them."""
    from companion.recording.reader import read  # noqa: PLC0415 - not for the drone

    recording = read(flight)
    link = recording.config.link
    place = Place(
        link.origin_lat_deg if lat_deg is None else lat_deg,
        link.origin_lon_deg if lon_deg is None else lon_deg,
        radians(heading_deg),
    )
    with needs_extra("export"):
        from companion.export.formats import Labels, export  # noqa: PLC0415
        from companion.export.plan.survey import survey  # noqa: PLC0415

        labels = Labels(_title(recording), place)
        names = [name.value for name in format_]
        export(survey(_plan(recording)), names, out, flight.stem, labels, tell=print)


@commands.command("report")
def report_command(
    flight: File,
    out: Annotated[
        Path | None, typer.Option(help="The page; the recording's name with .html if left out.")
    ] = None,
) -> None:
    """Write one HTML page from which somebody who was not there understands the flight."""
    from companion.recording.reader import read  # noqa: PLC0415 - not for the drone

    recording = read(flight)
    path = out or flight.with_suffix(".html")
    with needs_extra("export"):
        from companion.report.page import write_report  # noqa: PLC0415

        write_report(recording, _plan(recording), _title(recording), path)
    print(path)


def _plan(recording: "Recording") -> FloorPlan:
    """The flight's own map, or what can be made of a recording that was cut short."""
    from companion.recording.replay import replay  # noqa: PLC0415 - not for the drone

    return recording.plan or replay(recording).final_floor_plan()


def _title(recording: "Recording") -> str:
    began = datetime.fromtimestamp(recording.began_unix_s, UTC)
    return f"Flight of {began:%Y-%m-%d %H:%M} UTC"


def _end_s(recording: "Recording") -> float:
    if not recording.ticks:
        raise RecordingError(f"{recording.path}: it ends before the flight began")
    return recording.ticks[-1].now_s

"""Makes one map from several flights: `companion merge`; runs on a laptop."""

from math import degrees, hypot
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from companion.core.errors import ConfigError, RecordingError

if TYPE_CHECKING:
    from companion.recording.reader import Recording
    from companion.survey.merge import Flown, Merged

MIN_SHARED_WALLS = 2
"""Least walls that confirm where a flight began. Chosen: two walls determine a place."""
EXIT_LEFT_OUT = 1
"""Exit status if a flight is left out. Chosen."""

commands = typer.Typer()


@commands.command("merge")
def merge_command(
    flights: Annotated[
        list[Path], typer.Argument(metavar="FLIGHT.mcap ...", help="Recordings of flights.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the map.")] = Path("out"),
    pad_sigma_m: Annotated[
        float, typer.Option(min=0.001, max=1.0, help="Standard deviation of the starts, m.")
    ] = 0.05,
    pad_sigma_deg: Annotated[
        float, typer.Option(min=0.01, max=20.0, help="Standard deviation of the headings, °.")
    ] = 3.0,
) -> None:
    """Make one map from flights that began at the same place; see docs/surveys.md.

    Exit status 1 if a flight did not fit and is left out of the map.
    """
    import numpy as np  # noqa: PLC0415 - not for the drone

    from companion.export.map_files import save  # noqa: PLC0415
    from companion.recording.reader import read  # noqa: PLC0415
    from companion.survey.merge import merge  # noqa: PLC0415

    console = Console(highlight=False, markup=False)
    recordings = [read(path) for path in flights]
    _check(recordings)
    flown = []
    for number, recording in enumerate(recordings, 1):
        console.print(f"solving flight {number} of {len(recordings)}: {recording.path.name}")
        flown.append(_flown(recording))
    console.print("solving all flights together")
    pad_sigma = np.array([pad_sigma_m, pad_sigma_m, np.radians(pad_sigma_deg)])
    merged = merge(flown, pad_sigma)
    files = save(merged.plan, out)
    console.print(_summary(merged))
    for each in merged.left_out:
        console.print(f"left out: {each.name}: {each.reason}")
    console.print(f"map: {', '.join(str(file) for file in files)}")
    if merged.left_out:
        raise typer.Exit(EXIT_LEFT_OUT)


def _check(recordings: "list[Recording]") -> None:
    """Refuse recordings that do not belong together."""
    first = recordings[0]
    for recording in recordings[1:]:
        if recording.config.sensors != first.config.sensors:
            raise ConfigError(
                f"{recording.path}: [sensors] differs from that of {first.path}; "
                "merge flights of one drone with the same sensors"
            )
    paths = [recording.path.resolve() for recording in recordings]
    for path in paths:
        if paths.count(path) > 1:
            raise RecordingError(f"{path}: named twice; its measurements would count twice")


def _flown(recording: "Recording") -> "Flown":
    from companion.recording.replay import replay  # noqa: PLC0415 - not for the drone
    from companion.survey.merge import Flown  # noqa: PLC0415

    return Flown.of(recording.path.name, replay(recording))


def _summary(merged: "Merged") -> Table:
    """Table of the flights: where each began, and what it shares with the others."""
    table = Table(title="flights", title_justify="left")
    for column in ("flight", "began off the pad", "heading off", "walls shared"):
        table.add_column(column)
    for flight in merged.flights:
        north_m, east_m, yaw_rad = flight.start.tolist()
        shared = str(flight.shared_walls)
        if len(merged.flights) > 1 and flight.shared_walls < MIN_SHARED_WALLS:
            shared += ": placed by its pad alone"
        off = f"{100 * hypot(north_m, east_m):.0f} cm", f"{degrees(yaw_rad):+.1f}°"
        table.add_row(flight.name, *off, shared)
    length_m = sum(wall.length_m for wall in merged.plan.walls)
    table.caption = f"{len(merged.plan.walls)} walls, {length_m:.1f} m in all"
    return table

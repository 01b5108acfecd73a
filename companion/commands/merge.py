"""Makes one map from several flights: `companion merge`; runs on a laptop."""

from enum import StrEnum
from math import degrees, hypot, isfinite, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from companion.core.errors import ConfigError, RecordingError
from companion.survey.pad import PAD_SIGMA_DEG, PAD_SIGMA_M

if TYPE_CHECKING:
    from companion.core.arrays import Array
    from companion.recording.reader import Recording
    from companion.survey.merge import Merged, MergedFlight

MIN_SHARED_WALLS = 2
"""Least walls that confirm where a flight began. Chosen: two walls determine a place."""
EXIT_LEFT_OUT = 1
"""Exit status if a flight is left out. Chosen."""


class StartsKnown(StrEnum):
    """What is known of where the flights began."""

    PAD = "pad"
    UNKNOWN = "unknown"


commands = typer.Typer()


@commands.command("merge")
def merge_command(
    flights: Annotated[
        list[Path], typer.Argument(metavar="FLIGHT.mcap ...", help="Recordings of flights.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the map.")] = Path("out"),
    starts: Annotated[
        StartsKnown,
        typer.Option(help="Flights began on the pad of the first, or at unknown places."),
    ] = StartsKnown.PAD,
    start: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FLIGHT=NORTH,EAST,HEADING",
            help="Where a flight began in the frame of the first, m, m, °; repeatable.",
        ),
    ] = None,
    pad_sigma_m: Annotated[
        float | None,
        typer.Option(
            min=0.001,
            max=1.0,
            help=f"Standard deviation of the starts, m; default {PAD_SIGMA_M}, or of the team.",
        ),
    ] = None,
    pad_sigma_deg: Annotated[
        float | None,
        typer.Option(
            min=0.01,
            max=20.0,
            help=f"Standard deviation of headings, °; default {PAD_SIGMA_DEG}, or of the team.",
        ),
    ] = None,
) -> None:
    """Make one map from several flights; see docs/surveys.md.

    Flights of one team begin on the team's pads.

    Exit status 1 if a flight did not fit and is left out of the map.
    """
    import numpy as np  # noqa: PLC0415 - not for the drone

    from companion.export.map_files import save  # noqa: PLC0415
    from companion.recording.reader import read  # noqa: PLC0415
    from companion.survey.folder import Pad  # noqa: PLC0415
    from companion.survey.merge import Starts, merge  # noqa: PLC0415
    from companion.survey.solved import is_kept, kept_or_solved  # noqa: PLC0415
    from companion.survey.team_starts import team_sigma, team_starts  # noqa: PLC0415

    console = Console(highlight=False, markup=False)
    recordings = [read(path) for path in flights]
    _check(recordings)
    names = [recording.path.name for recording in recordings]
    given = team_starts(recordings) | _given(start or [], names)
    flown = []
    for number, recording in enumerate(recordings, 1):
        if not is_kept(recording.path, out):
            console.print(f"solving flight {number} of {len(recordings)}: {recording.path.name}")
        flown.append(kept_or_solved(recording, out))
    if starts is StartsKnown.UNKNOWN:
        console.print("searching where the flights began")
    console.print("solving all flights together")
    sigma = np.maximum(Pad().sigma, team_sigma(recordings))
    sigma_m, sigma_rad = pad_sigma_m or sigma[0], np.radians(pad_sigma_deg or 0.0) or sigma[-1]
    pad_sigma = np.array([sigma_m, sigma_m, sigma_rad])
    merged = merge(flown, Starts(pad_sigma, given, starts is StartsKnown.UNKNOWN))
    files = save(merged.plan, out)
    console.print(_summary(merged))
    for each in merged.left_out:
        console.print(f"left out: {each.name}: {each.reason}")
    for change in merged.changes:
        console.print(change.in_words(merged.flights[change.flight].name), soft_wrap=True)
    console.print(f"map: {', '.join(str(file) for file in files)}")
    if merged.left_out:
        raise typer.Exit(EXIT_LEFT_OUT)


def _check(recordings: "list[Recording]") -> None:
    """Refuse recordings that do not belong together."""
    from companion.survey.folder import check_same_sensors  # noqa: PLC0415 - not for the drone
    from companion.survey.team_starts import check_same_team  # noqa: PLC0415

    check_same_sensors(recordings)
    check_same_team(recordings)
    paths = [recording.path.resolve() for recording in recordings]
    names = [path.name for path in paths]
    for path in paths:
        if paths.count(path) > 1:
            raise RecordingError(f"{path}: named twice; its measurements would count twice")
        if names.count(path.name) > 1:
            raise RecordingError(f"{path}: another recording has this name; rename one of them")


def _given(texts: list[str], names: list[str]) -> "dict[str, Array]":
    """Known starts (3,) by the name of the flight."""
    import numpy as np  # noqa: PLC0415 - not for the drone

    given: dict[str, Array] = {}
    for text in texts:
        name, _, place = text.rpartition("=")
        if name not in names[1:]:
            first = " is the first flight, whose start is the origin" if name == names[0] else ""
            known = f"the others are {', '.join(names[1:])}" if first else "no flight of this name"
            raise ConfigError(f"--start {text}: {name or text}{first}; {known}")
        if name in given:
            raise ConfigError(f"--start {text}: {name} has a start already")
        try:
            north_m, east_m, heading_deg = (float(part) for part in place.split(","))
        except ValueError:
            raise ConfigError(
                f"--start {text}: write three numbers, as in {name}=1.5,-2,90"
            ) from None
        if not all(isfinite(number) for number in (north_m, east_m, heading_deg)):
            raise ConfigError(f"--start {text}: the numbers must be finite")
        given[name] = np.array([north_m, east_m, radians(heading_deg)])
    return given


def _summary(merged: "Merged") -> Table:
    """Table of the flights: where each began, and what it shares with the others."""
    table = Table(title="flights", title_justify="left")
    is_pad = all(flight.pad is not None for flight in merged.flights)
    began = ("began off the pad", "heading off") if is_pad else ("began north", "east", "heading")
    for column in ("flight", *began, "walls shared"):
        table.add_column(column)
    for flight in merged.flights:
        shared = str(flight.shared_walls)
        if (
            len(merged.flights) > 1
            and flight.shared_walls < MIN_SHARED_WALLS
            and flight.pad is not None
        ):
            shared += ": placed by its pad alone"
        table.add_row(flight.name, *(_off_the_pad if is_pad else _began)(flight), shared)
    length_m = sum(wall.length_m for wall in merged.plan.walls)
    table.caption = f"{len(merged.plan.walls)} walls, {length_m:.1f} m in all"
    return table


def _off_the_pad(flight: "MergedFlight") -> tuple[str, str]:
    north_m, east_m, yaw_rad = flight.off_the_pad.tolist()
    return f"{100 * hypot(north_m, east_m):.0f} cm", f"{degrees(yaw_rad):+.1f}°"


def _began(flight: "MergedFlight") -> tuple[str, str, str]:
    north_m, east_m, yaw_rad = flight.start.tolist()
    heading_deg = (degrees(yaw_rad) + 180) % 360 - 180
    return f"{north_m:+.2f} m", f"{east_m:+.2f} m", f"{heading_deg:+.1f}°"

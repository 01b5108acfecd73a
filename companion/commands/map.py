"""Makes the map of a log that another program recorded: `companion map`; prints its schema."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.core.errors import OutputError
from companion.export.map_record import map_schema
from companion.offline.console import LogProgress, log_summary
from companion.offline.files import save_results
from companion.offline.mapper import map_log
from companion.offline.reading import sensors as log_sensors
from companion.offline.reading.readers import read_log
from companion.offline.stretches import held_stretches

commands = typer.Typer()


@commands.command("map")
def map_command(
    log: Annotated[Path, typer.Argument(help="CSV file; see docs/offline.md.")],
    config: Annotated[
        Path | None, typer.Option(help="TOML file of the sensors; default: LOG's name with .toml.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the map.")] = Path("out"),
) -> None:
    """Make the map of a recorded log: map.png, map.ply, map.json, trajectory.tum, report.json.

    If the map of the whole log is doubtful, its longest stretches whose maps hold follow in folders
    of their own.
    """
    console = Console(highlight=False, markup=False)
    sensors = log_sensors.load(config, log)
    with LogProgress(console) as progress:
        rows = read_log(log, progress.show)
        result = map_log(rows, sensors, progress.show)
        doubtful = not result.verdict.trusted
        stretches = held_stretches(rows, sensors, progress.show) if doubtful else []
    try:
        files = save_results(result, stretches, out)
    except OutputError:  # print the summary even if a file cannot be written
        console.print(log_summary(result, stretches, []))
        raise
    console.print(log_summary(result, stretches, files))


@commands.command("map-schema")
def map_schema_command() -> None:
    """Print the JSON schema of map.json and of `export --format json`; see docs/exports.md."""
    print(json.dumps(map_schema(), indent=2, ensure_ascii=False))

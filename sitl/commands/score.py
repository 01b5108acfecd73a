"""`sitl score`: scores a companion's map against the true flight that `sitl run` wrote."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer
from rich.console import Console

from companion.core.values import value
from companion.export.map_files import load_json
from sitl.core.errors import SitlError
from sitl.running.options import (
    Autopilot,
    Clutter,
    ClutterSeed,
    ConfigFile,
    Crop,
    FlightOptions,
    Profile,
    Seed,
    Start,
    WorldName,
)
from sitl.simulation.record import TruthRecord

if TYPE_CHECKING:
    from sitl.scoring.report import Report

T = TypeVar("T")


@value
class _Flown:
    """Result of a flight; its files do not contain how it ended."""

    completed: bool = True
    ending: str = "scored from its files"


def score(
    world: WorldName,
    map_file: Annotated[Path, typer.Argument(metavar="MAP", help="The companion's map.json.")],
    truth: Annotated[Path, typer.Argument(help="The file that `sitl run --truth` wrote.")],
    seed: Seed = 1,
    profile: Profile = "gp2y0a710k0f",
    start: Start = None,
    crop: Crop = None,
    clutter: Clutter = 0.0,
    clutter_seed: ClutterSeed = None,
    config: ConfigFile = None,
    report: Annotated[Path | None, typer.Option(help="File for the scores, JSON.")] = None,
) -> None:
    """Score a flight of `sitl run` and `companion fly`, with the same options as `run`."""
    # This module loads the scorer, which `sitl run` does not need.
    from sitl.scoring.report import report_table, save_report  # noqa: PLC0415

    options = FlightOptions(
        world,
        seed,
        profile,
        Autopilot.ARDUPILOT.value,
        start,
        crop_m=crop,
        config=config,
        clutter=clutter,
        clutter_seed=clutter_seed,
    )
    result = scored(options, map_file, truth)
    del result["completed"]
    Console(highlight=False).print(report_table(result))
    if report is not None:
        save_report(result, report)


def scored(options: FlightOptions, map_file: Path, truth: Path) -> "Report":
    """All scores of a flight, from its files.

    Raises:
        SitlError: a file is missing or invalid.
    """
    from sitl.scoring.report import make_report  # noqa: PLC0415 - likewise

    for path in (map_file, truth):
        if not path.is_file():
            raise SitlError(f"{path}: no such file; MAP is from companion fly, TRUTH from sitl run")
    return make_report(
        options.setup()[0],
        options.settings({}),
        _loaded(load_json, map_file),
        _loaded(TruthRecord.load, truth),
        outcome=_Flown(),
        waited_s=math.nan,
    )


def _loaded(load: Callable[[Path], T], path: Path) -> T:
    try:
        return load(path)
    except (ValueError, LookupError, TypeError, OSError, RecursionError) as error:
        raise SitlError(
            f"{path}: cannot be used: {error!r}; MAP is from companion fly, TRUTH from sitl run"
        ) from error

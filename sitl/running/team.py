"""Flies a team in simulation, for `sitl fly --team`."""

import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from companion.app import App, Progress
from companion.config.settings import Config
from companion.recording.recorder import NOT_RECORDED, Recorder, open_recorder
from companion.run.console import ProgressLine
from sitl.running.options import FlightOptions
from sitl.scoring.team_report import TeamResult, scored
from sitl.simulation.team import fly_team_in_lockstep
from sitl.simulation.team_pads import team_setups

_ROWS = (
    ("drone", "{}"),
    ("ending", "{}"),
    ("flight_time_s", "{:.0f}"),
    ("collisions", "{}"),
    ("clearance_m", "{:.2f}"),
    ("return_m", "{:.2f}"),
    ("radio_bytes_s", "{:.0f}"),
)
"""Keys and formats of the terminal's table."""


def fly_team(
    options: FlightOptions, settings: Config, drones: int, *, out: Path | None, console: Console
) -> TeamResult:
    """Fly a team; the recordings are written to `out`, the map is not.

    Raises:
        SitlError: there is no place for a pad.
        ConfigError: the mission is not one that so many drones divide.
    """
    began_s = time.monotonic()
    setup, _ = options.setup()
    setups, configs = team_setups(setup, settings, drones)
    recorders = [
        open_recorder(out, config, time.time(), console.print) if out else NOT_RECORDED
        for config in configs
    ]
    with ProgressLine(console) as progress:

        def show(number: int, shown: Progress) -> None:
            if number == 0:
                progress.show(shown)

        flight = fly_team_in_lockstep(setups, configs, show, recorders=recorders)
    result = scored(setup, configs, flight, time.monotonic() - began_s)
    _close(recorders, flight.apps)
    table = Table(title=f"drones in {setup.world.name}", title_justify="left")
    for column, _ in _ROWS:
        table.add_column(column)
    for row in result.rows:
        table.add_row(*(form.format(row[key]) for key, form in _ROWS))
    console.print(table)
    return result


def _close(recorders: Sequence[Recorder], apps: Sequence[App]) -> None:
    for recorder, app in zip(recorders, apps, strict=True):
        recorder.close(app.final_floor_plan())

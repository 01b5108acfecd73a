"""Flies a team in simulation, for `sitl fly --team`, in one process or in one for each drone."""

import socket
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.table import Table

from companion.app import App
from companion.config.settings import Config
from companion.core.errors import RecordingError
from companion.pdps.flight.state import FINAL_PHASES
from companion.recording.reader import read
from companion.recording.recorder import NOT_RECORDED, Recorder, open_recorder
from companion.recording.replay import replay
from companion.run.console import ProgressLine
from companion.ticks import Outputs, Progress
from sitl.core.errors import SitlError
from sitl.running.options import FlightOptions
from sitl.running.processes import CONFIG_FILE, TRUTH_FILE, fly_in_processes
from sitl.scoring.team_report import FlownDrone, TeamResult, scored, scored_together
from sitl.simulation.record import TruthRecord
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
    console.print(_table(setup.world.name, result))
    return result


def fly_team_in_processes(
    options: FlightOptions,
    settings: Config,
    drones: int,
    speed: float,
    *,
    out: Path,
    console: Console,
) -> TeamResult:
    """Fly a team over UDP, served buses and Zenoh, as on drones; each has a folder in `out`.

    The joint map is not written. A companion that crashes is a row that says so.

    Raises:
        SitlError: there is no place for a pad, nothing is recorded, or no flight can be made into
            a map.
        ConfigError: the mission is not one that so many drones divide.
    """
    if not settings.recording.enabled:
        raise SitlError("recording.enabled = false: the joint map is made of recordings")
    began_s = time.monotonic()
    setup, _ = options.setup()
    _, configs = team_setups(setup, settings, drones)
    addresses = _free_addresses(drones)
    companions = {
        out / f"drone_{number}": config.model_copy(
            update={"team": config.team.model_copy(update={"addresses": addresses})}
        )
        for number, config in enumerate(configs, 1)
    }
    before = [set(_recordings(folder)) for folder in companions]
    served = replace(options, config=next(iter(companions)) / CONFIG_FILE)
    ended = fly_in_processes(
        [*served.arguments(), f"--team={drones}", f"--speed={speed}"],
        companions,
        out / TRUTH_FILE,
    )
    waited_s = time.monotonic() - began_s
    console.print("making the joint map from the recordings")
    flown = [
        _replayed([each for each in _recordings(folder) if each not in known], truth, status)
        for folder, known, truth, status in zip(
            companions, before, ended.truths, ended.statuses, strict=True
        )
    ]
    result = scored_together(setup, configs[0], flown, waited_s)
    console.print(_table(setup.world.name, result))
    return result


def _recordings(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.mcap"))


def _free_addresses(drones: int) -> tuple[str, ...]:
    """Free TCP ports on this machine, for the radios."""
    with ExitStack() as stack:
        sockets = [
            stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in range(drones)
        ]
        return tuple(f"127.0.0.1:{each.getsockname()[1]}" for each in sockets)


def _replayed(recordings: Sequence[Path], truth: TruthRecord, status: int) -> FlownDrone:
    """A drone at the end of its flight, by its recording, if there is one."""
    crash = f"the companion crashed with exit status {status}"
    sent_bytes = 0

    def count(outputs: Outputs) -> None:
        nonlocal sent_bytes
        sent_bytes += sum(map(len, outputs.team))

    try:
        app = replay(read(recordings[-1]), count) if recordings else None
    except RecordingError:
        app = None
    is_over = app is not None and app.flight.phase in FINAL_PHASES
    return FlownDrone(app, truth, sent_bytes, "" if is_over else crash)


def _table(world: str, result: TeamResult) -> Table:
    table = Table(title=f"drones in {world}", title_justify="left")
    for column, _ in _ROWS:
        table.add_column(column)
    for row in result.rows:
        table.add_row(*(form.format(row[key]) for key, form in _ROWS))
    return table


def _close(recorders: Sequence[Recorder], apps: Sequence[App]) -> None:
    for recorder, app in zip(recorders, apps, strict=True):
        recorder.close(app.final_floor_plan())

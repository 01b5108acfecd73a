"""Flies a team in simulation and scores its joint map, for `sitl fly --team`.

The pads stand near the start pose. Each drone is told where the pads are, and stands some
centimetres and degrees off its own.
"""

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from companion.app import App, Progress
from companion.config.settings import Config, PadConfig, TeamConfig, validated
from companion.core.errors import SurveyError
from companion.core.frames import Vector2, moved
from companion.recording.recorder import NOT_RECORDED, Recorder, open_recorder
from companion.run.console import ProgressLine
from companion.survey.flights import Flown
from companion.survey.merge import Merged, Starts, merge
from sitl.core.errors import SitlError
from sitl.core.noise import stream
from sitl.running.options import FlightOptions
from sitl.running.sorties import return_m, together
from sitl.scoring.report import Report, make_report
from sitl.simulation.fleet import SEEDS_APART
from sitl.simulation.record import AIRBORNE_M, TruthRecord
from sitl.simulation.simulation import Setup, start_state
from sitl.simulation.team import TeamFlight, fly_team_in_lockstep
from sitl.world.format import Start
from sitl.world.geometry.model import BODY_RADIUS_M, WorldModel

TEAM = TeamConfig(name="sitl")
"""Defaults of a team: how exactly the drones stand on their pads."""
PADS_APART_M, MAX_PADS_APART_M, PAD_STEP_M = 2.0, 6.0, 0.25
"""Least distance between two pads, greatest from the start, and step between the distances that are
tried, m. Chosen: a drone climbs while its neighbour waits."""
PAD_BEARINGS = 24
"""Bearings from the start that are tried for a pad. Chosen."""
PAD_CLEAR_M = 0.25
"""Least clearance of a hull over a pad, at the height of the mission, m. Chosen."""
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


@dataclass(frozen=True, slots=True)
class TeamResult:
    """A flight of a team as `sitl fly` reports it."""

    joint: Report
    """Scores of the joint map, with the keys of a single flight's report."""
    rows: list[Report]
    """Each drone's own results."""
    merged: Merged

    def as_json(self) -> dict[str, object]:
        """The scores, with the rows as `drones`."""
        return {**self.joint, "drones": self.rows}


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


def team_setups(setup: Setup, settings: Config, drones: int) -> tuple[list[Setup], list[Config]]:
    """A setup and a configuration for each drone.

    Raises:
        SitlError: there is no place for a pad.
        ConfigError: the mission is not one that so many drones divide.
    """
    take_off = start_state(setup)
    start_ne_m = take_off.position_ned_m[0], take_off.position_ned_m[1]
    offsets = pad_offsets(setup, settings.mission.height_m, drones)
    pads = tuple(PadConfig(north_m=ahead, east_m=right) for ahead, right in offsets)
    setups, configs = [], []
    for number, offset in enumerate(offsets):
        team = TEAM.model_copy(update={"drone": number + 1, "pads": pads})
        values = settings.model_dump(exclude_defaults=True) | {"team": team.model_dump()}
        configs.append(validated(Config, values, f"--team {drones}"))
        draw = stream(setup.seed, f"pad {number}")
        error_m, error_rad = (
            (TEAM.pad_sigma_m, math.radians(TEAM.pad_sigma_deg)) if number else (0.0, 0.0)
        )
        north_m, east_m = moved(start_ne_m, offset, take_off.yaw_rad)
        heading_deg = math.degrees(take_off.yaw_rad + draw.gauss(0, error_rad))
        place = draw.gauss(north_m, error_m), draw.gauss(east_m, error_m)
        pose = Start(name=f"pad {number + 1}", position=place, heading_deg=heading_deg)
        setups.append(
            replace(
                setup,
                world=setup.world.model_copy(update={"starts": (pose,)}),
                start=0,
                seed=setup.seed + SEEDS_APART * number,
            )
        )
    return setups, configs


def pad_offsets(setup: Setup, height_m: float, drones: int) -> list[Vector2]:
    """Where the pads stand, forward and right of the start, m; the first is the start itself.

    Raises:
        SitlError: there is no place for a pad.
    """
    take_off = start_state(setup)
    start_ne_m = take_off.position_ned_m[0], take_off.position_ned_m[1]
    model = WorldModel(setup.world)

    def is_free(offset: Vector2) -> bool:
        """True if the way from the start to the pad is free, too."""
        places = (moved(start_ne_m, (s * offset[0], s * offset[1]), take_off.yaw_rad) for s in _WAY)
        return all(
            model.clearance_m((north_m, east_m, -height_m)) > BODY_RADIUS_M + PAD_CLEAR_M
            for north_m, east_m in places
        )

    chosen: list[Vector2] = [(0.0, 0.0)]
    for offset in _candidates():
        is_apart = all(math.dist(offset, each) > PADS_APART_M - 1e-3 for each in chosen)
        if len(chosen) < drones and is_apart and is_free(offset):
            chosen.append(offset)
    if len(chosen) < drones:
        raise SitlError(
            f"--team {drones}: there is room for {len(chosen)} pads near the start; choose another "
            "start, or fewer drones"
        )
    return chosen


def _candidates() -> Iterator[Vector2]:
    """Places for pads, nearest first; those to the right of the start before the others."""
    steps = round((MAX_PADS_APART_M - PADS_APART_M) / PAD_STEP_M)
    for away_m in (PADS_APART_M + PAD_STEP_M * step for step in range(steps + 1)):
        for number in range(PAD_BEARINGS):
            bearing_rad = math.pi / 2 + math.tau * number / PAD_BEARINGS
            yield (
                round(away_m * math.cos(bearing_rad), 3),
                round(away_m * math.sin(bearing_rad), 3),
            )


_WAY = tuple(np.linspace(0.0, 1.0, 25).tolist())
"""Shares of the way from the start to a pad."""


def scored(
    setup: Setup, configs: Sequence[Config], flight: TeamFlight, waited_s: float
) -> TeamResult:
    """Make and score the joint map.

    Raises:
        SitlError: no flight can be made into a map.
    """
    team = configs[0].team
    flown, truths = [], [vehicle.record for vehicle in flight.fleet.vehicles]
    given = {}
    for number, (app, pad) in enumerate(zip(flight.apps, team.pads, strict=True), 1):
        name = f"flight {number}"
        try:
            flown.append(Flown.of(name, app))
        except SurveyError:
            continue
        given[name] = np.array([pad.north_m, pad.east_m, math.radians(pad.heading_deg)])
    if not flown:
        raise SitlError("no flight of the team can be made into a map")
    sigma = np.array([team.pad_sigma_m, team.pad_sigma_m, math.radians(team.pad_sigma_deg)])
    merged = merge(flown, Starts(sigma, given))
    joint = make_report(
        setup,
        configs[0],
        merged.plan,
        together(truths, merged),
        outcome=_Outcome(flight.apps),
        waited_s=waited_s,
    )
    joint["return_m"] = round(max(map(return_m, truths)), 4)
    joint["flight_time_s"] = round(_airborne_s(truths), 4)
    joint["apart_m"] = round(flight.fleet.least_apart_m, 4)
    rows = [
        _row(number, app, truth, flight.air.sent_bytes[number])
        for number, (app, truth) in enumerate(zip(flight.apps, truths, strict=True))
    ]
    return TeamResult(joint, rows, merged)


class _Outcome:
    """How the flight of the team ended."""

    def __init__(self, apps: Sequence[App]) -> None:
        flights = [app.flight for app in apps]
        self.completed = all(flight.completed for flight in flights)
        self.ending = "; ".join(dict.fromkeys(flight.ending for flight in flights))


def _airborne_s(truths: Sequence[TruthRecord]) -> float:
    """Time from the first take-off to the last landing, s."""
    airborne = [
        state.time_s
        for truth in truths
        for state in truth.path
        if -state.position_ned_m[2] > AIRBORNE_M
    ]
    return max(airborne, default=0.0) - min(airborne, default=0.0)


def _row(number: int, app: App, truth: TruthRecord, sent_bytes: int) -> Report:
    """Results of one drone."""
    return {
        "drone": number + 1,
        "completed": app.flight.completed and truth.collisions == 0,
        "ending": app.flight.ending,
        "flight_time_s": round(truth.air_time_s, 2),
        "collisions": truth.collisions,
        "clearance_m": round(truth.clearance_m, 4),
        "return_m": round(return_m(truth), 4),
        "radio_bytes_s": round(sent_bytes / max(truth.path[-1].time_s, 1.0), 1),
    }

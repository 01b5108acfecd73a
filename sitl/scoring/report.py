"""Builds a flight's report: its results scored against the ground truth."""

import json
import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Protocol

import numpy as np
from rich.table import Table

from companion.config.settings import Config
from companion.core.frames import Vector2
from companion.core.messages import Beam, FloorPlan
from companion.drivers.models import range_models
from companion.export.map_files import save_as
from companion.navigation.standoff import standoff_m
from sitl.scoring.score import clear_in_the_open_m, least_time_s, score_map, score_trajectory
from sitl.simulation.record import AIRBORNE_M, TruthRecord
from sitl.simulation.simulation import Setup
from sitl.world.format import Segment, World
from sitl.world.geometry.model import BODY_RADIUS_M
from sitl.world.plan import observable_points, wall_surfaces

Report = dict[str, float | int | bool | str | None]
WALL_CLOCK_KEYS = ("speed_factor", "waited_s")
"""Keys that may differ between two flights of the same seed."""


class Outcome(Protocol):
    """The companion's result of a flight; `FlightState` is one."""

    @property
    def completed(self) -> bool: ...

    @property
    def ending(self) -> str: ...


def make_report(
    setup: Setup,
    config: Config,
    plan: FloorPlan,
    truth: TruthRecord,
    *,
    outcome: Outcome,
    waited_s: float,
) -> Report:
    """All scores of one flight; the key has the unit."""
    height_m = config.mission.height_m
    surfaces = wall_surfaces(setup.world, height_m)
    north, east, _ = truth.take_off.position_ned_m
    observable = observable_points(setup.world, height_m, (north, east))
    standoff = standoff_m(
        config.mission.standoff,
        range_models(config.sensors)[Beam.FRONT],
        config.sensors.mount_offset_m,
    )
    report: Report = {
        "world": setup.world.name,
        "profile": "mixed" if setup.sensors.ranges else setup.sensors.profile,
        "beam": str(setup.beam),
        "seed": setup.seed,
        "completed": outcome.completed and truth.collisions == 0,
        "ending": outcome.ending,
    }
    closed = setup.world.closed_border
    report |= asdict(score_map(plan, surfaces, observable, truth.take_off, closed))
    report |= asdict(score_trajectory(plan.path, truth.path, truth.take_off))
    report |= {
        "collisions": truth.collisions,
        "clearance_m": truth.clearance_m,
        "clearance_open_m": least_clear_in_the_open_m(setup.world, truth),
        "return_m": math.dist(truth.path[-1].position_ned_m[:2], truth.take_off.position_ned_m[:2]),
        "flight_time_s": truth.air_time_s,
        "least_time_s": least_time_s(surfaces, standoff, config.mission.speed_m_s),
        "waited_s": waited_s,
        "speed_factor": truth.path[-1].time_s / waited_s,
    }
    return {key: _rounded(value) for key, value in report.items()}


def least_clear_in_the_open_m(world: World, truth: TruthRecord) -> float:
    """Smallest clearance to surfaces at the drone's height, in the air, outside passages, m."""
    places: dict[float, list[Vector2]] = defaultdict(list)
    for state in truth.path:
        north, east, down = state.position_ned_m
        if -down > AIRBORNE_M:
            places[round(-down, 1)].append((north, east))
    clear_m = (
        clear_in_the_open_m(_standing(world, height_m), np.array(at), BODY_RADIUS_M)
        for height_m, at in places.items()
    )
    return min(clear_m, default=math.inf)


def _standing(world: World, height_m: float) -> list[Segment]:
    """Surfaces that a drone can hit: also glass and the closed border."""
    return [*wall_surfaces(world, height_m, with_glass=True), *world.closed_border]


def _rounded(value: object) -> float | int | bool | str | None:
    if isinstance(value, float):
        return round(value, 4) if math.isfinite(value) else None
    assert isinstance(value, int | str)
    return value


def save_report(report: Mapping[str, object], path: Path) -> None:
    """Write a report as JSON.

    Raises:
        OutputError: the file cannot be written.
    """
    save_as(_write_report, report, path)


def _write_report(report: Mapping[str, object], path: Path) -> None:
    path.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")


_ROWS = (
    ("walls, in the take-off frame", "wall_error_cm", "{:.1f} cm"),
    ("walls, aligned", "wall_error_aligned_cm", "{:.1f} cm"),
    ("walls, sigma of the map", "wall_sigma_cm", "{:.1f} cm"),
    ("coverage", "coverage", "{:.1%}"),
    ("false walls", "false_walls", "{:.1%}"),
    ("trajectory (ATE)", "ate_cm", "{:.1f} cm"),
    ("least clearance", "clearance_m", "{:.2f} m"),
    ("least clearance, not in a passage", "clearance_open_m", "{:.2f} m"),
    ("collisions", "collisions", "{}"),
    ("distance from start at landing", "return_m", "{:.2f} m"),
    ("time in the air", "flight_time_s", "{:.0f} s"),
    ("least time to trace", "least_time_s", "{:.0f} s"),
    ("speed", "speed_factor", "{:.0f} × real time"),
)
"""Label, key and format of the terminal's table."""


def report_table(report: Report) -> Table:
    """The report as a table for the terminal."""
    flown = f"{report['world']} · {report['profile']} · seed {report['seed']}"
    table = Table(title=f"{flown}: {report['ending']}", show_header=False, title_justify="left")
    for label, key, form in _ROWS:
        value = report[key]
        table.add_row(label, "–" if value is None else form.format(value))
    return table

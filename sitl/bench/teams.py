"""Flies teams and compares each with one drone in the same world."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np
from rich.table import Table

from companion.app import App
from companion.config.settings import MissionConfig
from companion.core.arrays import Array
from companion.core.messages import FloorPlan, Hit
from companion.pdps.layers import layer_height_m
from sitl.bench import missions
from sitl.bench.engine import attempted
from sitl.bench.missions import Flown, Job, Sketch, in_world
from sitl.bench.scan_time import ScanTime
from sitl.bench.tables.worlds import world_table
from sitl.scoring.coverage_time import first_seen_s, time_to_see_s
from sitl.scoring.report import Report, make_report
from sitl.scoring.team_report import TeamResult, scored
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.simulation import Setup, start_state
from sitl.simulation.team import fly_team_in_lockstep
from sitl.simulation.team_pads import team_setups
from sitl.world.plan import observable_points, wall_surfaces

SAME_SHARE = 0.98
"""Time is compared at this share of the lower coverage of the two. Chosen: the last percents depend
on which corner happens to be the last."""
OF_A_SINGLE = ("completed", "coverage", "wall_error_aligned_cm", "flight_time_s", "collisions")
"""Keys of the comparison with one drone."""


@dataclass(frozen=True, slots=True)
class TeamJob:
    """A team to fly."""

    single: Job
    drones: int

    @property
    def key(self) -> Report:
        """Columns that identify its row."""
        return {**self.single.key, "mission": self.single.mission, "drones": self.drones}


@dataclass(frozen=True, slots=True)
class TeamFlown:
    """Result of a team, with a row for each drone."""

    joint: Flown
    drones: tuple[Report, ...] = ()

    @property
    def row(self) -> dict[str, Any]:
        """All results, for `--json`."""
        return {**self.joint.row, "rows": self.drones}


def fly(job: TeamJob) -> TeamFlown:
    """Fly; an exception becomes a row of the results."""
    return attempted(job, _fly, lost)


def lost(job: TeamJob, why: str) -> TeamFlown:
    """The row of a team without a report."""
    flown = missions.lost(job.single, why)
    return TeamFlown(Flown({**flown.row, **job.key}))


def _fly(job: TeamJob) -> TeamFlown:
    began_s = time.monotonic()
    setup, settings, _ = job.single.prepared()
    setups, configs = team_setups(setup, settings, job.drones)
    scan, alone = ScanTime(), ScanTime()
    flight = fly_team_in_lockstep(setups, configs, lambda number, progress: scan.watch(progress))
    waited_s = time.monotonic() - began_s
    team = scored(setup, configs, flight, waited_s)
    app, simulation = fly_in_lockstep(setup, settings, alone.watch)
    plan = app.final_floor_plan()
    single = make_report(
        setup, settings, plan, simulation.record, outcome=app.flight, waited_s=waited_s
    )
    times_s = _times(setup, _heights_m(app, settings.mission), team, plan)
    row: Report = {
        **team.joint,
        **job.key,
        "lost": False,
        "scan_time_s": scan.seconds,
        "scan_ratio": _ratio(scan.seconds, alone.seconds),
        "coverage_ratio": _ratio(*times_s),
        "landing_ratio": _ratio(team.joint["flight_time_s"], single["flight_time_s"]),
        **{f"single_{key}": single[key] for key in OF_A_SINGLE},
        "single_scan_time_s": alone.seconds,
    }
    truths = [vehicle.record for vehicle in flight.fleet.vehicles]
    walls = [
        (in_world(truths[0].take_off, wall.start_ne_m), in_world(truths[0].take_off, wall.end_ne_m))
        for wall in team.merged.plan.walls
    ]
    paths = [[state.position_ned_m[:2] for state in truth.path] for truth in truths]
    truth = wall_surfaces(setup.world, settings.mission.height_m)
    sketch = Sketch(truth, walls, paths, missions.places_of_hits(truths))
    return TeamFlown(Flown(row, sketch), tuple(team.rows))


def _heights_m(single: App, mission: MissionConfig) -> list[float]:
    """Heights of the layers that one drone has flown, m."""
    return [layer_height_m(number, mission) for number in range(len(single.rays))]


def _times(
    setup: Setup, heights_m: Sequence[float], team: TeamResult, single: FloorPlan
) -> tuple[float, float]:
    """Time to the same coverage at all heights, s: of the team, and of one drone."""
    hits = team.merged.plan.hits
    joint_s = [hit.time_s for hit in hits]
    later_s = [flight.later_s for flight in team.merged.flights]
    own_s = [
        at_s - later_s[number]
        for at_s, number in zip(joint_s, team.merged.flight_of(joint_s), strict=True)
    ]
    both = (
        _first_seen_s(setup, heights_m, hits, own_s),
        _first_seen_s(setup, heights_m, single.hits, _own_times(single.hits)),
    )
    share = SAME_SHARE * min(map(_seen_share, both))
    team_s, single_s = (time_to_see_s(seen_s, share) for seen_s in both)
    return team_s, single_s


def _first_seen_s(
    setup: Setup, heights_m: Sequence[float], hits: Sequence[Hit], times_s: Sequence[float]
) -> Array:
    """(n,): time at which each sample of the walls was first seen at its height, in order, s."""
    start = start_state(setup)
    north_m, east_m, _ = start.position_ned_m
    nearest = np.abs(
        np.array([-hit.position_ned_m[2] for hit in hits])[:, None] - np.array(heights_m)
    ).argmin(axis=1)
    seen_s = []
    for number, height_m in enumerate(heights_m):
        observable = observable_points(setup.world, height_m, (north_m, east_m))
        at = np.flatnonzero(nearest == number).tolist()
        of_height = [hits[each] for each in at], [times_s[each] for each in at]
        seen_s.append(first_seen_s(*of_height, observable, start))
    return np.sort(np.concatenate(seen_s))


def _own_times(hits: Sequence[Hit]) -> list[float]:
    return [hit.time_s for hit in hits]


def _seen_share(seen_s: Array) -> float:
    return float((seen_s < math.inf).mean())


def _ratio(of_team: object, of_one: object) -> float | None:
    if not isinstance(of_team, int | float) or not isinstance(of_one, int | float) or not of_one:
        return None
    return round(of_team / of_one, 3)


def sum_up(teams: Sequence[TeamFlown]) -> dict[str, Any]:
    """All rows and a total: the output of `--json`."""
    flown = [each.row for each in teams if not each.row["lost"]]
    totals: dict[str, Any] = {
        "teams": len(teams),
        "completed": sum(row["completed"] for row in flown),
        "lost": len(teams) - len(flown),
        "collisions": sum(row["collisions"] for row in flown),
    }
    if flown:
        apart_m = (row["apart_m"] for row in flown if row["apart_m"] is not None)
        totals["apart_min_m"] = min(apart_m, default=None)
        totals["coverage_median"] = round(median(row["coverage"] for row in flown), 4)
    for key in ("scan_ratio", "coverage_ratio", "landing_ratio"):
        ratios = [row[key] for row in flown if row[key] is not None]
        totals[f"{key}_mean"] = round(sum(ratios) / len(ratios), 3) if ratios else None
    return {"rows": [each.row for each in teams], "totals": totals}


_COLUMNS = (
    ("mission", "{mission}"),
    ("drones", "{drones}"),
    ("hits", "{collisions}"),
    ("apart\nm", "{apart_m:.2f}"),
    ("coverage", "{coverage:.1%}"),
    ("walls\ncm", "{wall_error_aligned_cm:.1f}"),
    ("one\ncm", "{single_wall_error_aligned_cm:.1f}"),
    ("scan\nratio", "{scan_ratio:.2f}"),
    ("same coverage\nratio", "{coverage_ratio:.2f}"),
    ("landing\nratio", "{landing_ratio:.2f}"),
)


def team_table(result: dict[str, Any]) -> Table:
    """A row for each team, and the totals as caption."""
    return world_table(result, _COLUMNS)

"""Flies, scores and sketches surveys: several flights with one joint map."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import median
from typing import Any

from rich.table import Table

from sitl.bench import missions
from sitl.bench.engine import attempted
from sitl.bench.missions import Flown, Job, Sketch, in_world
from sitl.bench.tables.worlds import world_table
from sitl.running.options import MAX_BATTERY_S
from sitl.running.sorties import Sorties
from sitl.scoring.report import Report
from sitl.world.plan import wall_surfaces

HOME_M = 0.3
"""A flight that lands within this distance of its take-off place is home, m."""
OF_A_SINGLE = ("completed", "coverage", "wall_error_aligned_cm", "flight_time_s", "collisions")
"""Keys of the comparison with a single flight."""


@dataclass(frozen=True, slots=True)
class SurveyJob:
    """A survey to fly."""

    first: Job
    """The first flight."""
    sorties: int
    """Most flights."""
    is_compared: bool = False
    """Fly the world also in one flight, with the battery of all of them."""
    drones: int = 1
    """Drones that fly together."""

    @property
    def key(self) -> Report:
        """Columns that identify its row."""
        return self.first.key


@dataclass(frozen=True, slots=True)
class SurveyFlown:
    """Result of a survey."""

    joint: Flown
    """Keys of the job and of the joint map's report, and its sketch."""
    sorties: tuple[Report, ...] = ()
    """A row for each flight."""
    left_out: tuple[str, ...] = ()
    """Flights that are not in the map, with reasons."""
    changes: tuple[Report, ...] = ()
    """What differs between flights, as in `report.json`."""

    @property
    def row(self) -> dict[str, Any]:
        """All results, for `--json`."""
        lists = {"sorties": self.sorties, "left_out": self.left_out, "changes": self.changes}
        return {**self.joint.row, **lists}


def fly(job: SurveyJob) -> SurveyFlown:
    """Fly; an exception becomes a row of the results."""
    return attempted(job, _fly, lost)


def lost(job: SurveyJob, why: str) -> SurveyFlown:
    """The row of a survey without a report."""
    return SurveyFlown(missions.lost(job.first, why))


def _fly(job: SurveyJob) -> SurveyFlown:
    setup, settings, _ = job.first.prepared()
    told: list[str] = []
    began_s = time.monotonic()
    sorties = Sorties(setup, settings, missions.ignore, tell=told.append, drones=job.drones)
    flights = list(sorties.fly(job.sorties))
    if not flights:
        return lost(job, "; ".join(told))
    last = flights[-1]
    rows = tuple(row for each in flights for row in each.rows)
    row: Report = {
        **last.joint,
        **job.key,
        "lost": False,
        "drones": job.drones,
        "flights": len(rows),
        "away": sum(return_m(each) > HOME_M for each in rows),
        "waited_s": round(time.monotonic() - began_s, 1),
        **(_single(job) if job.is_compared else {}),
    }
    take_off = sorties.truths[0].take_off
    walls = [
        (in_world(take_off, wall.start_ne_m), in_world(take_off, wall.end_ne_m))
        for wall in last.merged.plan.walls
    ]
    paths = [[state.position_ned_m[:2] for state in truth.path] for truth in sorties.truths]
    truth = wall_surfaces(setup.world, settings.mission.height_m)
    left_out = tuple(f"{each.name}: {each.reason}" for each in last.merged.left_out)
    changes = tuple(asdict(change) for change in last.merged.changes)
    sketch = Sketch(truth, walls, paths, missions.places_of_hits(sorties.truths))
    return SurveyFlown(Flown(row, sketch), rows, (*told, *left_out), changes)


def return_m(row: Report) -> float:
    """Distance of a flight's landing from its take-off, m."""
    return float(row["return_m"] or 0.0)


def _single(job: SurveyJob) -> Report:
    """Results of one flight with the battery of all flights, with a prefix."""
    options = job.first.options
    battery_s = min((options.battery_s or 0.0) * job.sorties, MAX_BATTERY_S)
    flown = missions.fly(replace(job.first, options=replace(options, battery_s=battery_s)))
    return {f"single_{key}": flown.row.get(key) for key in OF_A_SINGLE}


def sum_up(surveys: Sequence[SurveyFlown]) -> dict[str, Any]:
    """All rows and a total: the output of `--json`."""
    scored = [each.row for each in surveys if not each.row["lost"]]
    totals: dict[str, Any] = {
        "surveys": len(surveys),
        "completed": sum(row["completed"] for row in scored),
        "lost": len(surveys) - len(scored),
        **{key: sum(row[key] for row in scored) for key in ("flights", "collisions", "away")},
    }
    if scored:
        totals["coverage_median"] = round(median(row["coverage"] for row in scored), 4)
        totals["coverage_min"] = min(row["coverage"] for row in scored)
        totals["return_max_m"] = max(row["return_m"] for row in scored)
    return {"rows": [each.row for each in surveys], "totals": totals}


_COLUMNS = (
    ("flights", "{flights}"),
    ("hits", "{collisions}"),
    ("coverage by sortie", "{by_flight}"),
    ("walls\ncm", "{wall_error_aligned_cm:.1f}"),
    ("single\ncm", "{single_wall_error_aligned_cm:.1f}"),
    ("single\ncoverage", "{single_coverage:.0%}"),
    ("off pad\nmax", "{return_m:.2f}"),
    ("least\nclear", "{clearance_m:.2f}"),
    ("air\ns", "{flight_time_s:.0f}"),
)


def survey_table(result: dict[str, Any]) -> Table:
    """A row for each survey, and the totals as caption."""
    return world_table(result, _COLUMNS, _by_flight)


def _by_flight(row: dict[str, Any]) -> dict[str, Any]:
    by_sortie = {each.get("sortie", each["flight"]): each["coverage"] for each in row["sorties"]}
    return {"by_flight": " ".join(f"{coverage:.2f}" for coverage in by_sortie.values())}


def failed(surveys: Sequence[SurveyFlown]) -> Iterator[str]:
    """One line for each survey that was not completed, and each flight that did not come home."""
    for each in surveys:
        name = f"{each.row['world']}, seed {each.row['seed']}"
        if not each.row["completed"]:
            yield f"{name}: {each.row['ending']}"
        for sortie in each.sorties:
            if return_m(sortie) > HOME_M:
                off = f"landed {return_m(sortie):.2f} m off the pad: {sortie['ending']}"
                yield f"{name}, flight {sortie['flight']}: {off}"

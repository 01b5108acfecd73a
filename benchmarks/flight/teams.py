"""Flies teams and one drone in the same worlds: `python -m benchmarks.flight.teams --out DIR`.

Two drones in the paper's rooms and buildings, in the office, in random buildings, round a building
and in the layers of the office, and four in larger buildings; `--plans FOLDER` adds the plans of a
folder that are not malls, with four drones and a battery of 600 s. Prints a row for each team:
hits, least distance between drones, coverage, wall errors, and the team's share of the time that
one drone needs for one round of a room, for the same coverage, and until the last landing. A seed
of all worlds takes about two hours on two cores; the same command resumes an interrupted campaign.
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from rich.console import Console

from benchmarks.resumed import run_remaining
from benchmarks.survey.plans import BATTERY_S, BUILDINGS, plans_in
from companion.export.map_files import save_as
from sitl.bench.sets import from_first_starts, jobs_for
from sitl.bench.sheet import draw_sheet
from sitl.bench.teams import TeamFlown, TeamJob, fly, lost, sum_up, team_table

PROFILE = "gp2y0a710k0f"


@dataclass(frozen=True, slots=True)
class Group:
    """Worlds that teams of one size fly with one mission."""

    mission: str
    drones: int
    worlds: tuple[str, ...]
    battery_s: float | None = None


GROUPS: tuple[Group, ...] = (
    Group("room", 2, ("room_100", "room_200", "room_300")),
    Group("building", 2, ("two_room_300", "three_room_450", "complex", "office")),
    Group("building", 2, tuple(f"random_{seed}" for seed in range(1, 21))),
    Group("exterior", 2, ("exterior",)),
    Group("layers", 2, ("office",)),
    Group("building", 4, ("three_room_450", *BUILDINGS)),
)


def jobs(groups: tuple[Group, ...], seeds: int) -> list[TeamJob]:
    """A team in each world, from its first start."""
    return [
        TeamJob(job, group.drones)
        for group in groups
        for job in from_first_starts(
            jobs_for(group.worlds, seeds, [PROFILE], group.mission, battery_s=group.battery_s)
        )
    ]


def identity(row: Mapping[str, object]) -> tuple[object, ...]:
    """What tells a row from all others."""
    return tuple(row[key] for key in ("mission", "drones", "world", "seed"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for results and the sheet")
    parser.add_argument("--seeds", type=int, default=1, help="teams in each world")
    parser.add_argument("--plans", type=Path, help="folder with floor plans, for four drones")
    given = parser.parse_args()
    groups = GROUPS
    if given.plans:
        groups = (*groups, Group("building", 4, tuple(plans_in(given.plans)), BATTERY_S))
    teams = run_remaining(
        given.out / "teams.pickle",
        jobs(groups, given.seeds),
        is_of=lambda flown, job: identity(flown.row) == identity(job.key),
        run_one=fly,
        lose_one=lost,
        progress_text=lambda flown: f"{flown.row['world']}: {flown.row['ending']}",
    )
    show(teams)
    save_as(draw_sheet, [each.joint for each in teams], given.out / "teams.png")


def show(teams: list[TeamFlown]) -> None:
    """Print a table for each mission and number of drones."""
    console = Console(highlight=False)

    def group_of(flown: TeamFlown) -> tuple[str, int]:
        return flown.row["mission"], flown.row["drones"]

    for (mission, drones), group in groupby(sorted(teams, key=group_of), group_of):
        flown = sorted(group, key=lambda each: (each.row["world"], each.row["seed"]))
        console.print(f"\n{mission}, {drones} drones")
        console.print(team_table(sum_up(flown)))
        for each in flown:
            if not each.row["completed"]:
                name = f"{each.row['world']}, seed {each.row['seed']}"
                console.print(f"{name}: {each.row['ending']}", soft_wrap=True, markup=False)


if __name__ == "__main__":
    main()

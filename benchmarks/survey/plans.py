"""Surveys of real floor plans: `python -m benchmarks.survey.plans FOLDER --out DIR`.

Each plan of the folder that is not a mall, and three random buildings of 300 to 600 m², are flown
with a battery of 600 s in up to six flights from one pad, and in one long flight. Prints a row for
each survey, and writes a sheet of all plans with a colour for each flight to `DIR`. It takes about
two hours on two cores; the same command resumes an interrupted campaign.
"""

import argparse
import re
from pathlib import Path

from rich.console import Console

from benchmarks.resumed import run_remaining
from companion.export.map_files import save_as
from sitl.bench.sets import from_first_starts, jobs_for
from sitl.bench.sheet import draw_sheet
from sitl.bench.surveys import SurveyJob, failed, fly, lost, sum_up, survey_table

MALLS = re.compile(r"(.*_)?mall(_.*)?")
"""Names of the plans that are malls."""
BUILDINGS = tuple(f"random_large_{seed}" for seed in (1, 2, 3))
"""Random buildings of 300 to 600 m²."""
BATTERY_S, SORTIES = 600.0, 6
"""Time of a battery, s, and most flights."""


def plans_in(folder: Path) -> list[str]:
    """The floor plans that are not malls."""
    return sorted(str(path) for path in folder.glob("*.json") if not MALLS.fullmatch(path.stem))


def jobs(folder: Path) -> list[SurveyJob]:
    """A survey of each world, from its first start."""
    flights = jobs_for(
        [*plans_in(folder), *BUILDINGS], 1, ["gp2y0a710k0f"], "building", battery_s=BATTERY_S
    )
    return [SurveyJob(job, SORTIES, is_compared=True) for job in from_first_starts(flights)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="folder with floor plans")
    parser.add_argument("--out", type=Path, required=True, help="folder for results and the sheet")
    given = parser.parse_args()
    surveys = run_remaining(
        given.out / "surveys.pickle",
        jobs(given.folder),
        is_of=lambda flown, job: flown.row["world"] == job.key["world"],
        run_one=fly,
        lose_one=lost,
        progress_text=lambda flown: f"{flown.row['world']}: {flown.row['ending']}",
    )
    console = Console(highlight=False)
    console.print(survey_table(sum_up(surveys)))
    for line in failed(surveys):
        console.print(line, soft_wrap=True, markup=False)
    save_as(draw_sheet, [each.joint for each in surveys], given.out / "surveys.png")


if __name__ == "__main__":
    main()

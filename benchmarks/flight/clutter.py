"""Flies two hundred flights through clutter: `python -m benchmarks.flight.clutter --out DIR`.

The paper's worlds, the office and random buildings, each with clutter of 0.25, 0.5 and 0.75. Prints
a table, and writes a sheet of all plans for each clutter to `DIR`. It takes about three hours on
two cores; the same command resumes an interrupted campaign.
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.resumed import run_remaining
from companion.export.map_files import save_as
from sitl.bench.missions import Flown, Job, ending_in_words, fly, lost
from sitl.bench.sets import jobs_for
from sitl.bench.sheet import draw_sheet
from sitl.bench.summary import summarise
from sitl.scoring.report import Report

CLUTTERS = (0.25, 0.5, 0.75)
PROFILES = ("gp2y0a710k0f",)
SEEDS = {
    **dict.fromkeys(("room_100", "room_200", "room_300", "two_room_300", "unusual"), 8),
    **{"office": 3, "three_room_450": 3, "complex": 2},
    **{f"random_{number}": 1 for number in range(1, 20)},
}
"""Flights of each world per clutter, 67 in all; small rooms take less time."""
COLUMNS = (
    ("flights", "{:d}"),
    ("completed", "{:d}"),
    ("collisions", "{:d}"),
    ("false_alarms_per_h", "{:.1f}"),
    ("false_walls_mean", "{:.1%}"),
    ("false_walls_max", "{:.1%}"),
    ("coverage_mean", "{:.2f}"),
    ("coverage_min", "{:.2f}"),
    ("clearance_min_m", "{:.3f}"),
    ("wall_error_aligned_mean_cm", "{:.1f}"),
    ("return_mean_m", "{:.2f}"),
    ("return_max_m", "{:.2f}"),
    ("flight_time_mean_s", "{:.0f}"),
)
"""Keys of a summary, and their format."""


def jobs() -> list[Job]:
    """All flights."""
    return [
        job
        for world, seeds in SEEDS.items()
        for job in jobs_for([world], seeds, PROFILES, clutters=CLUTTERS)
    ]


def key(row: Report) -> tuple[object, ...]:
    return row["world"], row["seed"], row["clutter"]


def table(flown: Sequence[Flown]) -> Iterator[str]:
    """Markdown rows: one per clutter, and one for all."""
    names = [name.replace("_", " ") for name, _ in COLUMNS]
    yield "| clutter | " + " | ".join(names) + " |"
    yield "|---" * (1 + len(COLUMNS)) + "|"
    for clutter in (*CLUTTERS, None):
        rows = [each.row for each in flown if clutter in (None, each.row["clutter"])]
        summary = summarise(rows)
        cells = ["–" if summary[k] is None else form.format(summary[k]) for k, form in COLUMNS]
        yield f"| {'all' if clutter is None else clutter} | " + " | ".join(cells) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for flights and sheets")
    out: Path = parser.parse_args().out
    flown = run_remaining(
        out / "flown.pickle",
        jobs(),
        is_of=lambda each, job: key(each.row) == key(job.key),
        run_one=fly,
        lose_one=lost,
        progress_text=ending_in_words,
    )
    print(*table(flown), sep="\n")
    for clutter in CLUTTERS:
        mine = sorted(
            (each for each in flown if each.row["clutter"] == clutter),
            key=lambda each: str(key(each.row)),
        )
        if mine:
            save_as(draw_sheet, mine, out / f"clutter_{clutter}.png")


if __name__ == "__main__":
    main()

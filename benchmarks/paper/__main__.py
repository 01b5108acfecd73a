"""Reprints section 5 of the paper: `python -m benchmarks.paper --out DIR`.

Flies each scenario 15 times, and writes bar charts, map pictures, and 3-D maps of four buildings.
Prints the tables of docs/paper.md. It takes half an hour on two cores; the same command goes on
where the last one ended.
"""

import argparse
from dataclasses import replace
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.paper.charts import Rows, bar_chart, room_pictures, solid_picture
from benchmarks.paper.scenarios import (
    ADJUSTED,
    ERROR,
    PDPS,
    ROOMS,
    RUNS,
    TIME,
    TWO,
    VARIANTS,
    WHOLE,
    Variant,
    flight,
    flown,
    mean,
)
from companion.core.frames import Place
from companion.core.messages import FloorPlan
from companion.export.map_files import save_as
from companion.export.write import write
from sitl.bench import missions, teams
from sitl.bench.missions import Job, Sketch, ignore
from sitl.bench.teams import TeamJob
from sitl.campaign.flight import CampaignFlight
from sitl.simulation.lockstep import fly_in_lockstep

BUILDINGS = {
    "two_room_300": "two rooms, 300 m²",
    "three_room_450": "three rooms, 450 m²",
    "complex": "complex",
    "unusual": "unusual",
}
"""The buildings of figures 6 and 7."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("paper"), help="folder; default paper")
    parser.add_argument("--runs", type=int, default=RUNS, help="flights of each bar")
    given = parser.parse_args()
    rows = flown(given.out / "flights", given.runs)
    _print_tables(rows)
    for name, variants, title in (
        ("figure_09", (PDPS,), "Scenario 1: one UAV"),
        ("figure_11", (PDPS, TWO), "Scenario 2: one UAV and two"),
        ("figure_13", (PDPS, ADJUSTED), "Scenario 3: adjusted to the sensor's range"),
    ):
        save_as(partial(_draw_bars, rows, variants), title, given.out / f"{name}.png")
    for name, variant in (("figure_08", PDPS), ("figure_10", TWO), ("figure_12", ADJUSTED)):
        sketches = [(size, _sketch(room, variant)) for room, size in ROOMS.items()]
        save_as(partial(_draw_rooms, variant.name), sketches, given.out / f"{name}.png")
    plans = [(title, _map_of(world)) for world, title in BUILDINGS.items()]
    for (title, plan), world in zip(plans, BUILDINGS, strict=True):
        write(plan, given.out / f"figure_07_{world}.glb", title, Place(0.0, 0.0))
    save_as(solid_picture, plans, given.out / "figure_07.png")


def _draw_bars(rows: Rows, variants: tuple[Variant, ...], title: str, path: Path) -> None:
    bar_chart(rows, variants, title, path)


def _draw_rooms(title: str, sketches: list[tuple[str, Sketch]], path: Path) -> None:
    room_pictures(sketches, title, path)


def _sketch(room: str, variant: Variant) -> Sketch:
    job = flight(room, variant, seed=1).job()
    if variant.drones > 1:
        return teams.fly(TeamJob(job, variant.drones)).joint.sketch
    return missions.fly(job).sketch


def _map_of(world: str) -> FloorPlan:
    """The map of a building, flown once."""
    job: Job = CampaignFlight({"world": world, "profile": "paper", "mission": "building"}).job()
    setup, settings, _ = job.prepared()
    app, _ = fly_in_lockstep(setup, settings, ignore)
    plan = app.final_floor_plan()
    return plan if plan.ceiling_m else replace(plan, ceiling_m=setup.world.height_m)


def _print_tables(rows: Rows) -> None:
    console = Console(highlight=False)
    for title, key, digits in (
        ("Time of one round, s", TIME, 1),
        ("Time from take-off to landing, s", WHOLE, 1),
        ("Wall error after alignment, cm", ERROR, 2),
    ):
        table = Table("room", "flights", *(variant.name for variant in VARIANTS))
        table.add_column("two / one")
        table.add_column("adjusted / one")
        for room, size in ROOMS.items():
            means = [mean(rows[room, variant.name], key) for variant in VARIANTS]
            one, two, adjusted = (each.mean for each in means)
            cells = [f"{each.mean:.{digits}f} ± {each.half or 0.0:.{digits}f}" for each in means]
            number = str(sum(each.number for each in means))
            table.add_row(size, number, *cells, f"{two / one:.2f}", f"{adjusted / one:.2f}")
        console.print(f"{title}, mean and 95 % interval", table)


if __name__ == "__main__":
    main()

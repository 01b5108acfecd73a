"""Merges flights with unknown starts: `python -m benchmarks.survey.unknown_starts --out DIR`.

In each of the paper's seven worlds, two to five flights begin at places and headings drawn at
random, and are merged without their starts. Prints for each world how many flights were placed
right, wrong, or left out as ambiguous or with too little overlap; the mean error of the joint maps
of several flights, and of the best flight alone; and how many joint maps have an error below two of
their claimed sigmas.
The same command resumes an interrupted campaign.
"""

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import mean
from typing import Any

import numpy as np

from benchmarks.resumed import run_remaining
from companion.app import App
from companion.config import settings
from companion.config.settings import Config
from companion.core.frames import Vector2, ned_to_frd, wrap_rad
from companion.core.messages import FloorPlan
from companion.survey.flights import Flown
from companion.survey.merge import MergedFlight, Starts, merge
from sitl.bench.engine import attempted
from sitl.bench.sets import jobs_for
from sitl.core.noise import stream
from sitl.running.sorties import PAD
from sitl.scoring.joint import by_name, flight_name, together
from sitl.scoring.report import make_report
from sitl.sensors.beam import RAY
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.record import TruthRecord
from sitl.simulation.simulation import Setup, start_state
from sitl.world.format import Start, World
from sitl.world.geometry.model import WorldModel
from sitl.world.loading import load_world
from sitl.world.plan import reachable

MOST_FLIGHTS = 5
ROOM_M = 0.8
"""Least distance of a start from any surface, m."""
RIGHT_M, RIGHT_DEG = 0.3, 5.0
"""A placed flight is right within these errors of its start: its frame is known to 4 cm and 1°."""
CLAIMED_SIGMAS = 2.0
"""A map with a larger error, in its own sigmas, claims too much: 1 in 20 may."""


@dataclass(frozen=True, slots=True)
class Case:
    """Flights to merge."""

    world: str
    seed: int

    @property
    def flights(self) -> int:
        """Number of flights, from two."""
        return 2 + self.seed % (MOST_FLIGHTS - 1)


def run(case: Case) -> dict[str, Any]:
    """Fly and merge; an exception becomes a row of the results."""
    return attempted(case, _run, lost)


def lost(case: Case, why: str) -> dict[str, Any]:
    """The row of a case without a result."""
    return {"world": case.world, "seed": case.seed, "lost": why}


def _run(case: Case) -> dict[str, Any]:
    config = settings.load(None, {"mission.kind": "building"})
    world = load_world(case.world)
    setups = [
        replace(
            _setup(world, 1000 * case.seed + number, config),
            world=world.model_copy(update={"starts": (start,)}),
        )
        for number, start in enumerate(drawn_starts(world, config, case), 1)
    ]
    flown, truths, alone_cm = [], [], {}
    for number, setup in enumerate(setups, 1):
        app, simulation = fly_in_lockstep(setup, config, lambda _: None)
        flown.append(Flown.of(flight_name(number), app))
        truths.append(simulation.record)
        report = _scores(setup, config, app, app.final_floor_plan(), simulation.record)
        alone_cm[flight_name(number)] = report["wall_error_aligned_cm"]
    merged = merge(flown, Starts(PAD.sigma, are_unknown=True))
    joint = _scores(setups[0], config, app, merged.plan, together(truths, merged))
    flown_as = by_name(truths)
    right = sum(_is_right(each, truths[0], flown_as[each.name]) for each in merged.flights[1:])
    return {
        "world": case.world,
        "seed": case.seed,
        "right": right,
        "wrong": len(merged.flights) - 1 - right,
        "left_out": [each.reason for each in merged.left_out],
        "best_alone_cm": min(alone_cm[each.name] for each in merged.flights),
        "joint_cm": joint["wall_error_aligned_cm"],
        "sigmas": joint["wall_error_sigmas"],
    }


def drawn_starts(world: World, config: Config, case: Case) -> list[Start]:
    """Starts in the space that can be reached, with headings at random."""
    draw = stream(case.seed, f"{case.world} starts")
    height_m, model = config.mission.height_m, WorldModel(world)
    north, east, _ = start_state(_setup(world, case.seed, config)).position_ned_m
    places = [
        (north_m, east_m)
        for north_m, east_m in reachable(world, height_m, (north, east)).tolist()
        if model.clearance_m((north_m, east_m, -height_m)) >= ROOM_M
    ]
    return [_start(draw.choice(places), draw.uniform(0, 360)) for _ in range(case.flights)]


def _start(place: Vector2, heading_deg: float) -> Start:
    return Start(name="drawn", position=place, heading_deg=heading_deg)


def _setup(world: World, seed: int, config: Config) -> Setup:
    return Setup(world, world.name, seed, config.sensors, "ardupilot", {}, RAY)


def _scores(
    setup: Setup, config: Config, app: App, plan: FloorPlan, truth: TruthRecord
) -> dict[str, Any]:
    return dict(make_report(setup, config, plan, truth, outcome=app.flight, waited_s=1.0))


def _is_right(flight: MergedFlight, first_flown: TruthRecord, flown: TruthRecord) -> bool:
    """True if a placed flight began where the map says, in the frame of the first."""
    first, own = first_flown.take_off, flown.take_off
    north_m, east_m, _ = np.subtract(own.position_ned_m, first.position_ned_m)
    true_ne_m = ned_to_frd(float(north_m), float(east_m), first.yaw_rad)
    off_rad = wrap_rad(own.yaw_rad - first.yaw_rad - float(flight.start[2]))
    off_m = math.dist(true_ne_m, flight.start[:2].tolist())
    return off_m < RIGHT_M and abs(math.degrees(off_rad)) < RIGHT_DEG


def table(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Markdown rows: one per world."""
    yield "| world | merges | right | wrong | ambiguous | else left out | joint | best alone |"
    yield "|---" * 8 + "|"
    for world in sorted({row["world"] for row in rows}):
        mine = [row for row in rows if row["world"] == world and "lost" not in row]
        reasons = [reason for row in mine for reason in row["left_out"]]
        ambiguous = sum("fit equally" in reason or "fits equally" in reason for reason in reasons)
        counts = (len(mine), *(sum(row[key] for row in mine) for key in ("right", "wrong")))
        placed = [row for row in mine if row["right"]]
        errors = (
            f"{mean(row[key] for row in placed):.1f} cm" if placed else "-"
            for key in ("joint_cm", "best_alone_cm")
        )
        cells = (world, *counts, ambiguous, len(reasons) - ambiguous, *errors)
        yield "| " + " | ".join(map(str, cells)) + " |"
    for row in rows:
        if "lost" in row:
            yield f"\n{row['world']} seed {row['seed']} is lost: {row['lost']}"
    sigmas = [row["sigmas"] for row in rows if "lost" not in row]
    if sigmas:
        kept = sum(each < CLAIMED_SIGMAS for each in sigmas)
        yield f"\nerror below {CLAIMED_SIGMAS:.0f} of the claimed sigmas: {kept} of {len(sigmas)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=15, help="merges of each world, default 15")
    parser.add_argument("--out", type=Path, required=True, help="folder for the results")
    given = parser.parse_args()
    worlds = {str(job.key["world"]) for job in jobs_for(["paper"], 1, ["gp2y0a710k0f"])}
    rows = run_remaining(
        given.out / "merges.pickle",
        [Case(world, seed) for world in sorted(worlds) for seed in range(1, given.seeds + 1)],
        is_of=lambda row, case: (row["world"], row["seed"]) == (case.world, case.seed),
        run_one=run,
        lose_one=lost,
        progress_text=lambda row: f"{row['world']} seed {row['seed']}",
    )
    print(*table(rows), sep="\n")


if __name__ == "__main__":
    main()

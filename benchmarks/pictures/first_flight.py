"""Flies the paper's room 1 with many seeds: `python -m benchmarks.pictures.first_flight [--json]`.

Prints the table "The first flight" of README: mean and worst of 20 seeds with each sensor profile
at the reference noise.
"""

import argparse
import json
import time
from concurrent.futures import ProcessPoolExecutor
from statistics import mean

from companion.config import settings as configuration
from companion.ticks import Progress
from sitl.scoring.report import Report, make_report
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.simulation import Setup
from sitl.world.loading import load_world

PROFILES = ("paper", "gp2y0a710k0f")
COLUMNS = (
    ("walls, aligned, cm", "wall_error_aligned_cm", max),
    ("walls, take-off frame, cm", "wall_error_cm", max),
    ("ATE, cm", "ate_cm", max),
    ("coverage", "coverage", min),
    ("false walls", "false_walls", max),
    ("clearance, m", "clearance_m", min),
    ("waited, s", "waited_s", max),
    ("× real time", "speed_factor", min),
)


def flight(profile: str, seed: int, world: str) -> Report:
    """Fly one flight; return its report."""
    settings = configuration.load(None, {"sensors.profile": profile})
    setup = Setup(load_world(world), world, seed, settings.sensors)
    began_s = time.monotonic()

    def watch(progress: Progress) -> None:
        """Ignore the progress."""

    app, simulation = fly_in_lockstep(setup, settings, watch)
    plan = app.final_floor_plan()
    return make_report(
        setup,
        settings,
        plan,
        simulation.record,
        outcome=app.flight,
        waited_s=time.monotonic() - began_s,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--world", default="room_100")
    parser.add_argument("--json", action="store_true", help="every report, as one JSON list")
    options = parser.parse_args()
    jobs = [
        (profile, seed, options.world)
        for profile in PROFILES
        for seed in range(1, options.seeds + 1)
    ]
    with ProcessPoolExecutor() as pool:
        reports = list(pool.map(flight, *zip(*jobs, strict=True)))
    if options.json:
        print(json.dumps(reports, indent=1))
        return
    for profile in PROFILES:
        mine = [report for report in reports if report["profile"] == profile]
        completed = sum(bool(report["completed"]) for report in mine)
        collisions = sum(int(report["collisions"] or 0) for report in mine)
        print(
            f"{options.world}, {profile}: {completed} of {len(mine)} completed, "
            f"{collisions} collisions"
        )
        for label, key, worst in COLUMNS:
            values = [float(report[key] or 0) for report in mine]
            print(f"  {label:28} mean {mean(values):7.2f}   worst {worst(values):7.2f}")


if __name__ == "__main__":
    main()

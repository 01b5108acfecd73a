"""Maps recorded logs: `python -m benchmarks.mapping.offline [--seeds N]`.

Prints the table of docs/offline.md: for every kind of log the errors of the map and the trajectory,
and those of odometry alone. Logs are synthetic with known truth, and read from CSV without a TOML
beside them.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from statistics import mean
from tempfile import TemporaryDirectory

from benchmarks.mapping.offline_logs import SCENARIOS, Log, record, write_csv
from companion.core.arrays import Array
from companion.core.messages import FloorPlan, Pose
from companion.offline.mapper import map_log, odometry_map
from companion.offline.reading.log import ignore
from companion.offline.reading.readers import read_log
from companion.offline.reading.sensors import SensorsConfig
from sitl.scoring.score import MapScore, TrajectoryScore, score_map, score_trajectory
from sitl.world.plan import samples


@dataclass(frozen=True, slots=True)
class Score:
    """Scores of a map and its trajectory."""

    walls: MapScore
    trajectory: TrajectoryScore


@dataclass(frozen=True, slots=True)
class Outcome:
    """Scores of one log: mapped, and from odometry alone."""

    trusted: bool
    mapped: Score
    odometry: Score


def outcome(name: str, seed: int, rate_hz: float | None = None) -> Outcome:
    """Record, read, map and score a log; `rate_hz` replaces the scenario's rate."""
    scenario = SCENARIOS[name]()
    if rate_hz is not None:
        scenario = replace(scenario, flight=replace(scenario.flight, rate_hz=rate_hz))
    truth = record(scenario, seed)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        write_csv(truth, path)
        log = read_log(path, ignore)
    result = map_log(log, SensorsConfig(), ignore)
    return Outcome(
        result.verdict.trusted,
        _score(truth, result.plan, result.path),
        _score(truth, odometry_map(log, SensorsConfig()), log.odometry),
    )


def _score(truth: Log, plan: FloorPlan, path: Array) -> Score:
    observable = samples(list(truth.walls))
    walls = score_map(plan, truth.walls, observable, truth.true_states()[0])
    return Score(walls, score_path(truth, path))


def score_path(truth: Log, path: Array) -> TrajectoryScore:
    """Score the path (n, 3) of a map."""
    states = truth.true_states()
    poses = [
        Pose(time_s, north, east, 0.0, yaw)
        for time_s, (north, east, yaw) in zip(truth.time_s.tolist(), path.tolist(), strict=True)
    ]
    return score_trajectory(poses, states, states[0])


def _row(name: str, outcomes: Sequence[Outcome]) -> str:
    def both(attribute: str, part: str) -> str:
        found, odometry = (
            mean(getattr(getattr(getattr(one, which), part), attribute) for one in outcomes)
            for which in ("mapped", "odometry")
        )
        return f"{found:.1f} / {odometry:.1f}"

    trusted = sum(one.trusted for one in outcomes)
    cells = (
        name,
        both("wall_error_cm", "walls"),
        both("wall_error_aligned_cm", "walls"),
        both("ate_take_off_frame_cm", "trajectory"),
        both("ate_cm", "trajectory"),
        f"{100 * mean(one.mapped.walls.coverage for one in outcomes):.0f} %",
        f"{trusted} of {len(outcomes)}",
    )
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=8)
    options = parser.parse_args()
    jobs = list(product(SCENARIOS, range(1, options.seeds + 1)))
    with ProcessPoolExecutor() as pool:
        outcomes = dict(zip(jobs, pool.map(outcome, *zip(*jobs, strict=True)), strict=True))
    print("cm, mapped / by odometry alone; mean of", options.seeds, "seeds")
    print(
        "| log | walls, take-off frame | aligned | ATE, take-off frame | ATE | coverage | trusted |"
    )
    print("|---|---|---|---|---|---|---|")
    for name in SCENARIOS:
        print(_row(name, [one for (job, _), one in outcomes.items() if job == name]))


if __name__ == "__main__":
    main()

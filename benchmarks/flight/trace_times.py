"""Measures a room's trace with and without range adjustment.

Command: `python -m benchmarks.flight.trace_times`.

Prints the table of docs/missions.md, the paper's third scenario: rooms of 100, 200 and 300 m² at
1 m/s, along the walls at 1.5 m and at the sensor's range. Along four walls no trace is shorter than
(P - 8·d) / v; turns are excluded.
"""

import argparse
import tempfile
from pathlib import Path
from statistics import mean

import tomlkit

from sitl.bench.missions import Job, fly_and_show
from sitl.running.options import Autopilot, FlightOptions
from sitl.scoring.report import Report

WORLDS = ("room_100", "room_200", "room_300")
PROFILES = ("paper", "gp2y0a710k0f")
STANDOFFS = {"1.5": 1.5, "range": "range"}
COLUMNS = (
    ("least_time_s", "least, s"),
    ("trace_time_s", "trace, s"),
    ("trace_over_least", "trace / least"),
    ("flight_time_s", "in the air, s"),
    ("wall_error_aligned_cm", "walls, cm"),
    ("coverage", "coverage"),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=15, help="flights per case, as in the paper")
    seeds = range(1, parser.parse_args().seeds + 1)
    cases = [(p, s, w) for p in PROFILES for s in STANDOFFS for w in WORLDS]
    with tempfile.TemporaryDirectory() as folder:
        missions = {name: _mission(Path(folder), name) for name in STANDOFFS}
        jobs = [
            Job(FlightOptions(world, seed, profile, Autopilot.ARDUPILOT), missions[standoff])
            for profile, standoff, world in cases
            for seed in seeds
        ]
        rows = [flown.row for flown in fly_and_show(jobs)]
    print("| profile | stand-off | room | completed |", *(f"{name} |" for _, name in COLUMNS))
    print("|---" * (4 + len(COLUMNS)) + "|")
    for number, (profile, standoff, world) in enumerate(cases):
        mine = rows[number * len(seeds) : (number + 1) * len(seeds)]
        completed = sum(bool(row["completed"]) for row in mine)
        case = (profile, standoff, world, f"{completed} of {len(mine)}")
        print("|", *(f"{cell} |" for cell in (*case, *(_mean(mine, key) for key, _ in COLUMNS))))


def _mission(folder: Path, name: str) -> str:
    path = folder / f"{name}.toml"
    settings = {"kind": "room", "speed_m_s": 1.0, "standoff": STANDOFFS[name]}
    path.write_text(tomlkit.dumps({"mission": settings}))
    return str(path)


def _mean(rows: list[Report], key: str) -> str:
    values = [float(value) for row in rows if (value := row.get(key)) is not None]
    return f"{mean(values):.2f}" if values else "–"


if __name__ == "__main__":
    main()

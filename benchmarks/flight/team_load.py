"""What a team costs each companion: `python -m benchmarks.flight.team_load [WORLD] [--drones 4]`.

Prints a row for each drone: processor time for each second in the air, the time of a tick, bytes
that its radio sent, and the memory of its companion, with the map after landing. The times are of a
flight in one process, the memory is of one over real processes. It takes ten minutes on one core;
use one with nothing beside: `taskset -c 0 python -m ...`.
"""

import argparse
import tempfile
import time
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.measured import companions_mb
from benchmarks.timed import TimedApp
from sitl.bench.missions import Job
from sitl.bench.sets import jobs_for
from sitl.running.team import fly_team_in_processes
from sitl.scoring.team_report import scored
from sitl.simulation.team import fly_team_in_lockstep
from sitl.simulation.team_pads import team_setups

PROFILE, FASTEST = "gp2y0a710k0f", 1000.0


def timed(job: Job, drones: int) -> list[tuple[str, ...]]:
    """For each drone: ms for each second in the air, ms of a tick, kB/s."""
    setup, settings, _ = job.prepared()
    setups, configs = team_setups(setup, settings, drones)
    began_s = time.monotonic()
    flight = fly_team_in_lockstep(setups, configs, lambda *_: None, make_app=TimedApp)
    rows = scored(setup, configs, flight, time.monotonic() - began_s).rows
    return [
        (
            f"{app.ms_per_s:.0f}",
            f"{app.tick_ms(50):.1f}",
            f"{app.tick_ms(99):.1f}",
            f"{float(row['radio_bytes_s'] or 0) / 1000:.1f}",
        )
        for app, row in zip(flight.apps, rows, strict=True)
        if isinstance(app, TimedApp)
    ]


def memory_mb(job: Job, drones: int) -> list[float]:
    """Largest memory of each companion."""
    _, settings, _ = job.prepared()
    with tempfile.TemporaryDirectory() as folder:
        fly = partial(
            fly_team_in_processes,
            *(job.options, settings, drones, FASTEST),
            out=Path(folder),
            console=Console(quiet=True),
        )
        return companions_mb(fly)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("world", nargs="?", default="three_room_450", help="world to fly in")
    parser.add_argument("--drones", type=int, default=4, help="drones of the team, default 4")
    given = parser.parse_args()
    job = jobs_for([given.world], 1, [PROFILE], "building")[0]
    rows = timed(job, given.drones)
    table = Table("drone", "ms/s", "tick, median", "99 %, ms", "radio, kB/s", "memory, MB")
    memory = memory_mb(job, given.drones)
    for number, (row, mb) in enumerate(zip(rows, memory, strict=True), 1):
        table.add_row(str(number), *row, f"{mb:.0f}")
    Console(highlight=False).print(table)


if __name__ == "__main__":
    main()

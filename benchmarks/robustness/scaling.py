"""Flights a day on 8, 64 and 512 cores, from figures of this machine.

`python -m benchmarks.robustness.scaling`

Whole missions are flown in a bare process, which gives the time of a flight on one core. Jobs that
do nothing are run by the engine, and each row is kept as a campaign keeps it, which gives the
processor time of the command for each flight. It bounds the number of flights, since all results
pass through the command.
"""

import os
import tempfile
import time
from itertools import count
from pathlib import Path

import psutil

from sitl.bench.engine import run_all
from sitl.campaign.flight import CampaignFlight, fly
from sitl.campaign.results import Results
from sitl.campaign.scores import Row

WORLDS = "room_100", "two_room_300", "random_3", "random_7"
"""Worlds of the sample: a room, two rooms, and two random buildings."""
JOBS = 1000
CORES = 8, 64, 512
DAY_S = 86_400


def nothing(number: int) -> int:
    return number


def lost(number: int, why: str) -> int:
    raise RuntimeError(why)


def whole_missions() -> list[tuple[Row, float]]:
    """The rows of the sample, with the processor time of each, s."""
    flown = []
    for world in WORLDS:
        began_s = time.process_time()
        row = fly(CampaignFlight({"world": world, "seed": 1}))
        flown.append((row, time.process_time() - began_s))
    return flown


def command_s(row: Row) -> float:
    """Processor time of the command for each flight, with a row kept, s."""
    process, numbers = psutil.Process(), count()
    with tempfile.TemporaryDirectory() as folder:
        results = Results(Path(folder))

        def keep(_: int) -> None:
            results.add({**row, "flight": str(next(numbers))})

        began = process.cpu_times()
        run_all(range(JOBS), keep, nothing, lost)
        ended = process.cpu_times()
    return ((ended.user - began.user) + (ended.system - began.system)) / JOBS


def main() -> None:
    flown = whole_missions()
    flight_s = sum(each_s for _, each_s in flown) / len(flown)
    air_s = sum(row["flight_time_s"] for row, _ in flown) / len(flown)
    own_s = command_s(flown[0][0])
    print(f"{air_s:.0f} s in the air take {flight_s:.1f} s on one core of {os.cpu_count()}")
    print(
        f"the command takes {1e3 * own_s:.1f} ms for each flight: at most {1 / own_s:.0f} a second"
    )
    for cores in CORES:
        by_cores, by_command = cores * DAY_S / flight_s, DAY_S / own_s
        limit = "the flights" if by_cores < by_command else "the command"
        print(f"{cores} cores: {min(by_cores, by_command):,.0f} flights a day, limited by {limit}")


if __name__ == "__main__":
    main()

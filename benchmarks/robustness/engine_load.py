"""Measures the engine of campaigns: `python -m benchmarks.robustness.engine_load`.

Overhead: the same flights by the engine on one process, and one after the other in a bare process,
by turns. Memory: that of the scheduler's process after each thousand of ten thousand jobs of 10 ms.
"""

import time
from functools import partial
from itertools import count
from statistics import median

import psutil

from sitl.bench.engine import Crew, run_all
from sitl.campaign.flight import CampaignFlight, fly, lost
from sitl.campaign.scores import Row

FLIGHTS, ROUNDS = 6, 7
JOBS, JOB_S, EVERY = 10_000, 0.010, 1000
MB = 1e6


def short_flight(seed: int) -> CampaignFlight:
    return CampaignFlight(
        {"world": "room_100", "seed": seed, "mission.time_limit_s": 60, "mission.reserve_s": 0}
    )


def nap(number: int) -> int:
    time.sleep(JOB_S)
    return number


def nothing(number: int, why: str) -> int:
    return number


def flown_s(began_s: float) -> float:
    return time.monotonic() - began_s


def overhead() -> list[float]:
    """Time by the engine over time in a bare process; its start is not part of it."""
    flights = [short_flight(seed) for seed in range(FLIGHTS)]
    ratios = []
    for _ in range(ROUNDS):
        began_s = time.monotonic()
        for flight in flights:
            fly(flight)
        bare_s = flown_s(began_s)
        ends_s: list[float] = []
        run_all([flights[0], *flights], partial(_note, ends_s), fly, lost, Crew(workers=1))
        ratios.append((ends_s[-1] - ends_s[0]) / bare_s)
    return ratios


def _note(ends_s: list[float], row: Row) -> None:
    ends_s.append(time.monotonic())


def memory_mb() -> list[float]:
    """Memory of this process, in which the scheduler runs, after each thousand jobs, MB."""
    process, numbers, found = psutil.Process(), count(1), list[float]()

    def note(_: int) -> None:
        if next(numbers) % EVERY == 0:
            found.append(process.memory_info().rss / MB)

    run_all(range(JOBS), note, nap, nothing)
    return found


def main() -> None:
    ratios = overhead()
    print(f"time by the engine over that of a bare process: {median(ratios):.3f}")
    print("each round:", ", ".join(f"{ratio:.3f}" for ratio in ratios))
    found = memory_mb()
    print(f"{JOBS} jobs of {1e3 * JOB_S:.0f} ms; memory after each {EVERY}, MB:")
    print(", ".join(f"{each:.0f}" for each in found))


if __name__ == "__main__":
    main()

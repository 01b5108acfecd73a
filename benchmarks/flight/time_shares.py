"""Where the processor time of a flight goes: `python -m benchmarks.flight.time_shares [WORLD]`.

A timer interrupts a whole mission 500 times a second of processor time. Each sample counts for the
innermost function of this project that is running, by its module.
"""

import argparse
import signal
import time
from collections import Counter
from pathlib import Path
from types import FrameType

from sitl.campaign.flight import CampaignFlight, fly

EVERY_S = 0.002
"""Processor time between two samples, s."""
ROOT = Path(__file__).parents[2]
AREAS = {
    "smoothing": (
        "companion/estimation/smoothing",
        "companion/estimation/association",
        "companion/estimation/hypotheses",
    ),
    "filters": ("companion/estimation",),
    "health checks of the sensors": ("companion/safety/health",),
    "the velocity limiter": (
        "companion/safety/velocity_guard.py",
        "companion/safety/control_laws.py",
    ),
    "obstacle points near the drone": ("companion/safety",),
    "the occupancy grid": ("companion/mapping",),
    "mission, targets and paths": ("companion/pdps", "companion/navigation"),
    "sensors: drivers, emulated chips, rays": ("companion/drivers", "sitl/sensors", "sitl/world"),
    "autopilot and vehicle": ("sitl/autopilot", "sitl/core"),
    "the link": ("companion/link",),
}
"""Parts of the program, by the beginnings of their files' paths; the first that fits counts."""
MAP = "the map after landing"
SCORE = "the scores"
REST = "the loop and the rest"


class Sampler:
    """Counts samples by area."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()

    def take(self, _: int, frame: FrameType | None) -> None:
        """Signal handler: count the running function."""
        area = ""
        while frame:
            path = Path(frame.f_code.co_filename)
            if frame.f_code.co_name == "final_floor_plan":
                area = MAP
            elif frame.f_code.co_name == "make_report":
                area = SCORE
            elif not area and path.is_relative_to(ROOT):
                area = _area(path.relative_to(ROOT).as_posix())
            frame = frame.f_back
        self.counts[area or REST] += 1


def _area(path: str) -> str:
    return next((area for area, parts in AREAS.items() if path.startswith(parts)), "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("world", nargs="?", default="room_200", help="world; default room_200")
    given = parser.parse_args()
    sampler = Sampler()
    signal.signal(signal.SIGPROF, sampler.take)
    signal.setitimer(signal.ITIMER_PROF, EVERY_S, EVERY_S)
    began_s = time.process_time()
    row = fly(CampaignFlight({"world": given.world, "seed": 1}))
    took_s = time.process_time() - began_s
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    print(f"{given.world}: {row['flight_time_s']:.0f} s in the air, {took_s:.1f} s of CPU\n")
    print("| share | of |\n|---|---|")
    for area, count in sampler.counts.most_common():
        print(f"| {100 * count / sampler.counts.total():.0f} % | {area} |")


if __name__ == "__main__":
    main()

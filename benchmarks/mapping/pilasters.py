"""Measures the heading error around a house with pilasters.

Command: `python -m benchmarks.mapping.pilasters`.

Prints the figures of docs/how-it-maps.md: the heading error in flight, its 95 % quantile.
"""

import argparse
import math
from pathlib import Path

import numpy as np

from companion.app import App
from companion.core.frames import wrap_rad
from sitl.simulation.simulation import Simulation
from sitl.testing import Sitl, watch

WORLD = Path(__file__).parents[2] / "tests" / "flights" / "worlds" / "facade.toml"


class HeadingErrors:
    """Heading error at every tick, relative to the heading at take-off, deg."""

    def __init__(self) -> None:
        self.deg: list[float] = []

    def note(self, simulation: Simulation, app: App) -> None:
        if app.estimator is not None:
            truth, take_off = simulation.autopilot.truth, simulation.record.take_off
            off_rad = app.estimator.heading.yaw_rad - (truth.yaw_rad - take_off.yaw_rad)
            self.deg.append(abs(math.degrees(wrap_rad(off_rad))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    within_deg = []
    print("| seed | heading within, 95 % | walls, cm | completed |\n|---|---|---|---|")
    for seed in range(1, parser.parse_args().seeds + 1):
        errors = HeadingErrors()
        flight = Sitl(Path()).fly(
            str(WORLD), mission="exterior", seed=seed, script=[watch(errors.note)]
        )
        within_deg.append(np.quantile(errors.deg, 0.95))
        walls_cm = flight.report.wall_error_aligned_cm
        print(
            f"| {seed} | {within_deg[-1]:.1f}° | {walls_cm:.1f} | {flight.completed} |", flush=True
        )
    print(f"mean {np.mean(within_deg):.1f}°, worst {max(within_deg):.1f}°")


if __name__ == "__main__":
    main()

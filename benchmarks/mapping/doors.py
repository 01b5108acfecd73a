"""Compares mapped with true widths of doorways: `python -m benchmarks.mapping.doors [WORLD ...]`.

Prints the figures of docs/exports.md. By default it flies the paper's buildings, the office and
eight random buildings, some 60 doorways in all, in ten minutes on one core. A mapped opening
belongs to the doorway whose middle is nearest, within half a metre.
"""

import argparse
import math
from collections.abc import Iterator
from pathlib import Path
from statistics import mean

from companion.export.plan.survey import Opening, survey
from sitl.bench.missions import in_world
from sitl.testing import Flight, Sitl

WORLDS = (
    "two_room_300",
    "three_room_450",
    "complex",
    "office",
    *(f"random_{seed}" for seed in range(1, 9)),
)
SAME_M = 0.5
"""Largest distance between the middles of a mapped and a true doorway, m."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="*", default=list(WORLDS))
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    errors_m, sigmas = [], []
    missed = 0
    for world in options.worlds:
        flight = Sitl(Path()).fly(world, mission="building", seed=options.seed)
        for true_m, opening in _doorways(flight):
            if opening is None:
                missed += 1
                continue
            error_m = opening.width_m - true_m
            errors_m.append(error_m)
            sigmas.append(abs(error_m) / opening.sigma_m if opening.sigma_m else math.inf)
            print(
                f"{world}: {opening.width_m:.2f} m of {true_m:.2f} m, "
                f"{100 * error_m:+.1f} cm, sigma {100 * opening.sigma_m:.1f} cm",
                flush=True,
            )
    within = sum(each < 2 for each in sigmas)
    print(
        f"{len(errors_m)} doorways, {missed} not found; error {100 * mean(map(abs, errors_m)):.1f} "
        f"cm, mean {100 * mean(errors_m):+.1f} cm; {within} within two sigmas"
    )


def _doorways(flight: Flight) -> Iterator[tuple[float, Opening | None]]:
    """The true width of each doorway, m, and the opening that was mapped there."""
    openings = survey(flight.plan).openings
    middles = [
        tuple(
            (a + b) / 2
            for a, b in zip(
                in_world(flight.truth.take_off, opening.start_ne_m),
                in_world(flight.truth.take_off, opening.end_ne_m),
                strict=True,
            )
        )
        for opening in openings
    ]
    for door in (door for wall in flight.setup.world.walls for door in wall.doors):
        off_m = [math.dist(middle, door.centre) for middle in middles]
        nearest = min(range(len(off_m)), key=off_m.__getitem__, default=None)
        is_there = nearest is not None and off_m[nearest] < SAME_M
        yield door.width_m, openings[nearest] if is_there and nearest is not None else None


if __name__ == "__main__":
    main()

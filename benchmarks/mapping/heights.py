"""Compares mapped with true heights in the office.

Command: `python -m benchmarks.mapping.heights [--seeds 3]`.

Prints the table of docs/missions.md: floor, ceiling, and each table top below the flight, by
missions in layers.
"""

import argparse
from pathlib import Path

from sitl.testing import Sitl

SPACING_M = {"paper": 0.6, "gp2y0a710k0f": 0.8}
"""Layer spacing by profile, m. A Sharp needs more than a metre between upper layer and desks."""
CEILING_M, DESKS_M = 2.8, (0.72, 0.74)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    seeds = range(1, parser.parse_args().seeds + 1)
    print("| profile | seed | in the air, s | clearance, m | floor | ceiling | desks |")
    print("|---" * 7 + "|")
    for profile, spacing_m in SPACING_M.items():
        settings = {"mission.layer_spacing_m": spacing_m}
        for seed in seeds:
            flight = Sitl(Path()).fly(
                "office", mission="layers", seed=seed, profile=profile, settings=settings
            )
            off_cm = (
                _off_cm(flight.plan.floor_m, 0.0),
                _off_cm(flight.plan.ceiling_m, CEILING_M),
                ", ".join(_nearest_off_cm(top.height_m) for top in flight.plan.tops) or "none",
            )
            figures = f"{flight.truth.air_time_s:.0f} | {flight.report.clearance_m:.2f}"
            print(f"| {profile} | {seed} | {figures} |", " | ".join(off_cm), "|", flush=True)


def _nearest_off_cm(height_m: float) -> str:
    return _off_cm(height_m, min(DESKS_M, key=lambda desk_m: abs(desk_m - height_m)))


def _off_cm(mapped_m: float | None, true_m: float) -> str:
    return "–" if mapped_m is None else f"{100 * (mapped_m - true_m):+.1f} cm"


if __name__ == "__main__":
    main()

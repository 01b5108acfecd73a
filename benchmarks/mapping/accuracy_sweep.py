"""Measures errors over noise.

Command: `python -m benchmarks.mapping.accuracy_sweep [--seeds 5] [--out FILE]`.

Odometry noise times 0.5, 1 and 2, and a spread of the range sensors' gains of 0, 0.3, 1 and 3 %, in
`room_100` with `gp2y0a710k0f`. The companion's settings stay the same. Writes a table and a PNG.
"""

import argparse
from pathlib import Path

import matplotlib
import numpy as np

from companion.config import settings as configuration
from sitl.autopilot.estimation.estimator import REFERENCE_NOISE
from sitl.bench.accuracy import ERRORS, FlightResult, fly_all
from sitl.simulation.simulation import Setup
from sitl.world.loading import load_world

matplotlib.use("Agg")
from matplotlib import pyplot as plt

WORLD, PROFILE = "room_100", "gp2y0a710k0f"
NOISE_FACTORS = (0.5, 1.0, 2.0)
GAIN_SIGMAS = (0.0, 0.003, 0.01, 0.03)
LABELS = ("walls, aligned", "walls, take-off frame", "trajectory (ATE)")


def errors_cm(noise_factor: float, gain_sigma: float, seeds: int) -> list[float]:
    """Mean of each error in `ERRORS` over the seeds, cm."""
    sensors = configuration.load(None, {"sensors.profile": PROFILE}).sensors
    noise = REFERENCE_NOISE.times(noise_factor)
    setups = [
        Setup(
            load_world(WORLD),
            WORLD,
            seed,
            sensors,
            odometry_noise=noise,
            range_gain_sigma=gain_sigma,
        )
        for seed in range(1, seeds + 1)
    ]
    results = fly_all(setups)
    return [_mean(results, error) for error in ERRORS]


def _mean(results: list[FlightResult], error: str) -> float:
    values = [value for result in results if (value := result.report[error]) is not None]
    return float(np.mean(np.array(values, dtype=float)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--out", type=Path, default=Path("out/accuracy_sweep.png"))
    options = parser.parse_args()
    by_noise = [errors_cm(factor, 0.003, options.seeds) for factor in NOISE_FACTORS]
    by_gain = [errors_cm(1.0, sigma, options.seeds) for sigma in GAIN_SIGMAS]
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), sharey=True)
    for axis, name, places, rows in (
        (axes[0], "odometry noise, times", NOISE_FACTORS, by_noise),
        (axes[1], "spread of range gains, %", [100 * sigma for sigma in GAIN_SIGMAS], by_gain),
    ):
        print(f"{name:28}" + "".join(f"{label:>24}" for label in LABELS))
        for place, row in zip(places, rows, strict=True):
            print(f"{place:<28g}" + "".join(f"{error:21.1f} cm" for error in row))
        axis.plot(places, rows, marker="o", label=LABELS)
        axis.set(xlabel=name)
        axis.grid(visible=True, alpha=0.3)
    axes[0].set_ylim(bottom=0)
    axes[0].set_ylabel(f"mean error over {options.seeds} seeds, cm")
    axes[0].legend()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(options.out, dpi=120, bbox_inches="tight")
    print(f"wrote {options.out}")


if __name__ == "__main__":
    main()

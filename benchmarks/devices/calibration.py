"""Measures how well a tape measure calibrates a gain: `python -m benchmarks.devices.calibration`.

Sensors with 5 % too much gain and their usual noise go through `companion calibrate range`: five
distances, thirty seconds each. Prints the table of docs/check.md.
"""

import math
import statistics
from collections.abc import Callable

from companion.bringup.calibration_fit import Fit, fit, tape_point
from companion.bringup.capture import suggested_distances_m
from companion.config.settings import SensorsConfig
from companion.core.messages import Beam, RangeReading
from companion.drivers.models import range_models
from companion.drivers.ranges import RangeSensors
from sitl.core.truth import TrueState
from sitl.sensors.beam import RangeQuery
from sitl.sensors.board import SensorBoard

GAIN = 1.05
UNITS = 20
SECONDS = 30.0
TICK_S = 0.05
PROFILES = ("gp2y0a710k0f", "paper", "vl53l1x", "tfmini_s", "tf_luna")


def calibrated_unit(profile: str, seed: int) -> Fit:
    """Calibrate one sensor at the distances that the command suggests."""
    config = SensorsConfig.model_validate({"profile": profile, "mount_offset_m": 0.0})
    distance_m = 1.0
    time_s = 1.0

    def board_at(beam: Beam) -> RangeQuery:
        return lambda origin, direction, most_m: distance_m if distance_m <= most_m else None

    def still(at_s: float) -> TrueState:
        return TrueState(at_s, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)

    board = SensorBoard(seed, config, board_at, still)
    board.set_gain("front", GAIN)
    sensors = RangeSensors(board.bus, config)
    points = []
    for distance_m in suggested_distances_m(range_models(config)[Beam.FRONT]):
        readings: list[RangeReading] = []
        for _ in range(round(SECONDS / TICK_S)):
            time_s += TICK_S
            board.bus.set_time(time_s)
            readings.append(sensors.read(time_s).readings[Beam.FRONT])
        points.append(tape_point(distance_m, readings[10:]))
    return fit(points)


def rms(values: list[float], of: Callable[[float], float] = float) -> float:
    return math.sqrt(statistics.mean(of(value) ** 2 for value in values))


def main() -> None:
    print(f"{UNITS} units each, {100 * (GAIN - 1):.0f} % off, five distances of {SECONDS:.0f} s")
    print("sensor          gain off, rms    worst    sigma     residual")
    for profile in PROFILES:
        fits = [calibrated_unit(profile, seed) for seed in range(UNITS)]
        off = [found.calibration.gain / GAIN - 1 for found in fits]
        print(
            f"{profile:14s} {100 * rms(off):12.2f} % {100 * max(map(abs, off)):8.2f} %"
            f" {100 * rms([found.gain_sigma for found in fits]):7.2f} %"
            f" {1000 * rms([found.residual_m for found in fits]):8.1f} mm"
        )


if __name__ == "__main__":
    main()

"""Checks the yaw filter's consistency: `python -m benchmarks.mapping.yaw_consistency [--seeds 50]`.

A simulated gyro, through its bus and driver, turns as in a flight: at rest, a full turn, then along
four walls with a quarter turn between them. Every 2.5 s a run along the wall ahead measures its
bearing. The normalised innovation squared, (innovation / sigma)², has one degree of freedom. Its
mean over all observations must lie within the 95 % band of χ² / n around 1.
"""

import argparse
import math
import sys
from random import Random

import numpy as np
from scipy.stats import chi2

from companion.drivers.chips.lsm9ds1 import Lsm9ds1
from companion.estimation.filters.gyro_rest_calibration import RestCalibration
from companion.estimation.filters.heading_filter import HeadingFilter, WallBearing
from sitl.core.noise import stream
from sitl.sensors.i2c import DeviceBus
from sitl.sensors.lsm9ds1 import Lsm9ds1Device, draw_warming

ADDRESS = 0x6B
TICK_S = 0.05
REST_S, STILL_S, WALL_S = 3.0, 8.0, 10.0
TURN_RAD_S = math.radians(45)
SEEN_EVERY_S = 2.5
RUN_SIGMA_RAD = math.radians(0.7)


def yaw_rate_rad_s(time_s: float) -> float:
    """A full turn, then four walls with a quarter turn after each."""
    since_s = time_s - STILL_S
    if since_s < 0:
        return 0.0
    if since_s < math.tau / TURN_RAD_S:
        return TURN_RAD_S
    turn_s = 0.5 * math.pi / TURN_RAD_S
    in_leg_s = (since_s - math.tau / TURN_RAD_S) % (WALL_S + turn_s)
    return TURN_RAD_S if in_leg_s >= WALL_S else 0.0


def innovations(seed: int) -> list[float]:
    """Innovations of one flight, each divided by its sigma."""
    device = Lsm9ds1Device(
        yaw_rate_rad_s, stream(seed, "gyro"), draw_warming(stream(seed, "gyro temperature"))
    )
    bus = DeviceBus({ADDRESS: device})
    gyro, rest = Lsm9ds1(bus, ADDRESS), RestCalibration(REST_S)
    heading: HeadingFilter | None = None
    walls: dict[int, int] = {}
    found: list[float] = []
    true_yaw_rad, random = 0.0, Random(seed)
    for tick in range(1, round((STILL_S + math.tau / TURN_RAD_S + 4 * (WALL_S + 2.0)) / TICK_S)):
        time_s = tick * TICK_S
        bus.set_time(time_s)
        samples = gyro.read(time_s)
        steps = [time_s - TICK_S + (i + 0.5) * TICK_S / 50 for i in range(50)]
        true_yaw_rad += sum(map(yaw_rate_rad_s, steps)) * TICK_S / 50
        if heading is None:
            rest.add(samples)
            if rest.bias_rad_s is not None:
                heading = HeadingFilter(rest.bias_rad_s)
            continue
        heading.predict(samples)
        if tick % round(SEEN_EVERY_S / TICK_S) == 0:
            # The wall that the nose points at most closely.
            facing = round(true_yaw_rad / (math.pi / 2))
            late_rad = yaw_rate_rad_s(time_s) * (time_s - samples[-1].time_s)
            bearing_rad = facing * math.pi / 2 - true_yaw_rad + late_rad
            seen = WallBearing(
                bearing_rad + random.gauss(0, RUN_SIGMA_RAD), RUN_SIGMA_RAD, 0.0, 0.0
            )
            if facing % 4 in walls:
                innovation_rad, sigma_rad = heading.innovation(walls[facing % 4], seen)
                found.append(innovation_rad / sigma_rad)
                heading.correct_by_wall(walls[facing % 4], seen)
            else:
                walls[facing % 4] = heading.add_wall(seen)
    return found


def consistency(seeds: int) -> tuple[float, float, float]:
    """Mean normalised innovation squared, and its 95 % band."""
    normalised = np.concatenate([innovations(seed) for seed in range(1, seeds + 1)])
    count = len(normalised)
    low, high = chi2.ppf([0.025, 0.975], count) / count
    return float(np.mean(normalised**2)), float(low), float(high)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=50)
    mean, low, high = consistency(parser.parse_args().seeds)
    print(f"normalised innovation squared: mean {mean:.3f}, 95 % band {low:.3f} to {high:.3f}")
    sys.exit(0 if low <= mean <= high else 1)


if __name__ == "__main__":
    main()

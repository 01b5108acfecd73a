"""Runs the estimator for an hour of flight: `python -m benchmarks.flight.endurance [--minutes 60]`.

The drone circles in a 10 × 10 m room at 1 m/s, facing the walls, at the reference noise. Every five
minutes it prints a tick's mean time and 99th percentile, the memory, and the pose error.
"""

import argparse
import math
import time
from collections.abc import Iterator
from random import Random

import numpy as np

from benchmarks.measured import peak_mb
from companion.config.settings import SensorsConfig
from companion.core.frames import frd_to_ned, wrap_rad
from companion.core.messages import (
    BEARING_FRD_RAD,
    GyroSample,
    Odometry,
    RangeReading,
    RangeScan,
    RangeState,
)
from companion.drivers.chips.sharp import GP2Y0A710K0F
from companion.drivers.models import level_units
from companion.estimation.estimator import Estimator

TICK_S, SPEED_M_S, TURN_RAD_S = 0.05, 1.0, math.radians(45)
HALF_M, STANDOFF_M = 5.0, 2.0
REPORT_S = 300.0
GYRO_SCALE, GYRO_BIAS_RAD_S, GYRO_NOISE_RAD_S = 1.015, math.radians(0.08), math.radians(0.1)
ODOMETRY_SCALE, ODOMETRY_STEP_M = 1.03, 0.005 * math.sqrt(TICK_S / 0.1)


def motion() -> Iterator[tuple[float, float]]:
    """(displacement to the right, turn) per tick: clockwise along the walls, facing them."""
    side_m = 2 * (HALF_M - STANDOFF_M)
    while True:
        for _ in range(round(side_m / SPEED_M_S / TICK_S)):
            yield SPEED_M_S * TICK_S, 0.0
        for _ in range(round(0.5 * math.pi / TURN_RAD_S / TICK_S)):
            yield 0.0, TURN_RAD_S * TICK_S


def range_m(north_m: float, east_m: float, bearing_rad: float) -> float:
    """Range to the wall, m."""
    cos, sin = math.cos(bearing_rad), math.sin(bearing_rad)
    across = (HALF_M - math.copysign(north_m, cos * north_m)) / max(abs(cos), 1e-9)
    along = (HALF_M - math.copysign(east_m, sin * east_m)) / max(abs(sin), 1e-9)
    return min(across, along)


def fly(minutes: float) -> None:
    """Fly, and print a row every five minutes."""
    random = Random(1)
    sensors = SensorsConfig()
    estimator = Estimator(0.0, level_units(sensors))
    north_m, east_m, yaw_rad = HALF_M - STANDOFF_M, -(HALF_M - STANDOFF_M), 0.0
    start = north_m, east_m
    odometry = [0.0, 0.0]
    spent_s: list[float] = []
    print("| flown, min | a tick, mean, ms | p99, ms | memory, MB | pose off by, cm |")
    print("|---|---|---|---|---|")
    estimator.turn([GyroSample(0.0, 0.0)])
    moves = motion()
    for tick in range(1, round(60 * minutes / TICK_S) + 1):
        time_s = tick * TICK_S
        right_m, turn_rad = next(moves)
        yaw_rad = wrap_rad(yaw_rad + turn_rad)
        north, east = frd_to_ned(0.0, right_m, yaw_rad)
        north_m, east_m = north_m + north, east_m + east
        odometry[0] += ODOMETRY_SCALE * north + random.gauss(0, ODOMETRY_STEP_M)
        odometry[1] += ODOMETRY_SCALE * east + random.gauss(0, ODOMETRY_STEP_M)
        rate_rad_s = GYRO_SCALE * turn_rad / TICK_S + random.gauss(
            GYRO_BIAS_RAD_S, GYRO_NOISE_RAD_S
        )
        readings = {}
        for beam, bearing_rad in BEARING_FRD_RAD.items():
            true_m = range_m(north_m, east_m, yaw_rad + bearing_rad) - sensors.mount_offset_m
            sigma_m = GP2Y0A710K0F.sigma_m(min(max(true_m, 1.0), 5.5))
            measured_m = true_m + random.gauss(0, sigma_m)
            seen = GP2Y0A710K0F.min_m < measured_m < GP2Y0A710K0F.max_m
            readings[beam] = (
                RangeReading(RangeState.DISTANCE, measured_m, sigma_m**2)
                if seen
                else RangeReading(RangeState.NOTHING)
            )
        velocity = (north / TICK_S, east / TICK_S, 0.0)
        report = Odometry(time_s, (odometry[0], odometry[1], -1.2), velocity, yaw_rad)
        began_s = time.process_time()
        estimator.turn([GyroSample(time_s, rate_rad_s)])
        estimator.move(report)
        estimator.see(RangeScan(time_s, readings))
        estimator.improve(time_s)
        spent_s.append(time.process_time() - began_s)
        if tick % round(REPORT_S / TICK_S) == 0:
            pose = estimator.pose(time_s)
            off_m = math.dist(pose.ne_m, (north_m - start[0], east_m - start[1]))
            ms = 1e3 * np.array(spent_s)
            print(
                f"| {time_s / 60:.0f} | {ms.mean():.2f} | {np.percentile(ms, 99):.1f} "
                f"| {peak_mb():.0f} | {100 * off_m:.0f} |",
                flush=True,
            )
            spent_s.clear()
    began_s = time.process_time()
    smoothed = estimator.smoothed()
    assert smoothed is not None
    took_s = time.process_time() - began_s
    print(f"\nThe map at the end: {len(smoothed.walls)} walls, {took_s:.1f} s, {peak_mb():.0f} MB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    fly(parser.parse_args().minutes)

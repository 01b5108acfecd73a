"""The noise of the odometry is learnt from the ranges to known walls."""

import math
from random import Random

import pytest

from companion.estimation.odometry_noise import OdometryNoise

REFERENCE_M2_PER_S = 0.005**2 / 0.1
TICK_S, WALL_M, RANGE_SIGMA_M = 0.05, 2.0, 0.02


def learnt(wander_m: float, swing_rad_s: float = 2.0, wall: int | None = 0) -> float:
    """Sigma of the odometry's error within a second, beside a wall to the north for a minute."""
    noise, random = OdometryNoise(REFERENCE_M2_PER_S), Random(1)
    for tick in range(1200):
        time_s = tick * TICK_S
        off_m = wander_m * math.sin(swing_rad_s * time_s)
        north_m = WALL_M + off_m + random.gauss(0, RANGE_SIGMA_M)
        noise.see(0, wall, time_s, ((north_m, 0.0), 0.0, RANGE_SIGMA_M**2))
    return math.sqrt(noise.variance_m2_per_s)


def test_odometry_that_does_not_err_keeps_the_reference() -> None:
    assert learnt(0.0) == pytest.approx(math.sqrt(REFERENCE_M2_PER_S))


@pytest.mark.parametrize("wander_m", [0.05, 0.1])
def test_a_wandering_estimate_is_noticed_and_measured(wander_m: float) -> None:
    within_a_second_m = math.sqrt(2) * wander_m * math.sin(1.0)  # rms of a swing of 2 rad/s
    assert learnt(wander_m) == pytest.approx(within_a_second_m, rel=0.2)


def test_hits_of_no_known_wall_tell_nothing() -> None:
    assert learnt(0.1, wall=None) == pytest.approx(math.sqrt(REFERENCE_M2_PER_S))

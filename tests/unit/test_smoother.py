"""The smoother's parts: the equations, the noise, the walls, and the filters that go on from it."""

import math
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.yaw_consistency import consistency
from companion.drivers.lsm9ds1 import SampleClock
from companion.drivers.sharp import GP2Y0A710K0F, PAPER
from companion.estimation.association import associate
from companion.estimation.bordered import BorderedSystem
from companion.estimation.estimator import Estimator
from companion.estimation.in_flight import PERIOD_S
from companion.estimation.keyframes import Keyframe, KeyframeHit
from companion.estimation.unknowns import Measured, RangeNoise, Unknowns
from companion.messages import Beam, GyroSample, Odometry, Pose, RangeReading, RangeScan, RangeState


@settings(deadline=None)
@given(st.integers(0, 10_000))
def test_the_bordered_system_solves_least_squares(seed: int) -> None:
    """Twelve unknowns in a chain, three shared ones: step and covariance as by dense algebra."""
    random = np.random.default_rng(seed)
    chained, shared, rows = 12, 3, 40
    system = BorderedSystem(chained, shared, bandwidth=4)
    jacobian, residual = np.zeros((rows, chained + shared)), random.normal(size=rows)
    for row in range(rows):
        places = [row % (chained - 3), row % (chained - 3) + 3]
        common = int(random.integers(shared))
        values = random.normal(size=3)
        jacobian[row, [*places, chained + common]] = values
        system.add(
            residual[row : row + 1],
            1.0,
            [(np.array([p]), np.array([v])) for p, v in zip(places, values, strict=False)],
            [(np.array([common]), values[2:])],
        )
    for place in range(chained):
        system.add(np.zeros(1), 1.0, [(np.array([place]), np.ones(1))])
    information = jacobian.T @ jacobian + np.diag([1.0] * chained + [0.0] * shared)
    solution = system.solve()
    step = np.concatenate([solution.chained, solution.shared])
    assert step == pytest.approx(-np.linalg.solve(information, jacobian.T @ residual), abs=1e-6)
    last = [chained - 2, chained - 1, *range(chained, chained + shared)]
    expected = np.linalg.inv(information)[np.ix_(last, last)]
    assert solution.covariance_of_last(2) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("sensor", [PAPER, GP2Y0A710K0F])
def test_noise_is_the_same_at_any_distance_in_signals(sensor: object) -> None:
    noise = RangeNoise(sensor)  # type: ignore[arg-type]
    for distance_m in (1.25, 2.15, 4.25):
        near, far = np.array([distance_m - 0.01]), np.array([distance_m + 0.01])
        signals = float((noise.signal(far) - noise.signal(near))[0])
        assert signals == pytest.approx(0.02 / float(noise.sigma_m(near)[0]), rel=0.05)


def hits_on_a_wall(seed: int, sigma_m: float = 0.05) -> Measured:
    """Flown 4 m east along a wall 1.5 m north, two hits a keyframe."""
    random = Random(seed)
    frames = [
        Keyframe(0.2 * k, Pose(0.2 * k, 0.0, 0.2 * k, -1.2, 0.0), (0.0, 0.2), 0.0)
        for k in range(21)
    ]
    hits = [
        KeyframeHit(0.0, Beam.FRONT, k, (0.0, 0.0), 0.0, 1.5 + random.gauss(0, sigma_m), -1.2)
        for k in range(21)
        for _ in range(8)
    ]
    return Measured.of(frames, hits, 0.0)


def east_flight(walls: list[tuple[float, float]]) -> Unknowns:
    poses = np.array([(0.0, 0.2 * k, 0.0, 0.0) for k in range(21)])
    return Unknowns(poses, np.array(walls), 0.0, 0.0, np.zeros(6))


@pytest.mark.parametrize(
    "other", [(0.0, 1.58), (math.radians(4), 1.45), (math.radians(60), 2.0), (math.pi, 1.5)]
)
def test_one_wall_is_mapped_as_one(other: tuple[float, float]) -> None:
    x = east_flight([(0.0, 1.5), other])
    wall_of = associate(x, hits_on_a_wall(1), RangeNoise(PAPER), 0.1)
    assert len(x.walls) == 1
    assert x.walls[0] == pytest.approx((0.0, 1.5), abs=0.03)
    assert (wall_of == 0).mean() > 0.95


@settings(deadline=None, max_examples=30)
@given(st.floats(-0.02, 0.02), st.floats(0, 0.008))
def test_gyro_samples_are_stamped_when_they_were_taken(clock_error: float, phase_s: float) -> None:
    period_s = (1 + clock_error) / 119
    clock, taken = SampleClock(0.0), 0
    late_s: list[float] = []
    for tick in range(1, 400):
        now_s = 0.05 * tick
        count = int((now_s - phase_s) / period_s) - taken
        taken += count
        late_s.append(clock.stamp(now_s, count)[-1] - (taken * period_s + phase_s))
    assert max(map(abs, late_s[100:])) < period_s


def fly_east(estimator: Estimator, seconds: float, seed: int) -> None:
    """Past a wall 1.5 m north towards one at 9 m, 1 m/s, with noise."""
    random = Random(seed)
    walk_m = 0.005 * math.sqrt(0.05 / 0.1)
    north_error_m = east_error_m = 0.0
    estimator.turn([GyroSample(0.0, 0.0)])
    for tick in range(1, round(seconds / 0.05) + 1):
        time_s, east_m = 0.05 * tick, 0.05 * tick
        estimator.turn([GyroSample(time_s, 0.0)])
        north_error_m += random.gauss(0, walk_m)
        east_error_m += random.gauss(0, walk_m)
        place = north_error_m, 1.02 * east_m + east_error_m, -1.2
        estimator.move(Odometry(time_s, place, (0.0, 1.02, 0.0), 0.0))
        front = RangeReading(RangeState.DISTANCE, 1.5 + random.gauss(0, 0.05), 0.0025)
        right_m = 9.0 - east_m + PAPER.mean_age_s + random.gauss(0, 0.05)
        right = RangeReading(RangeState.DISTANCE, right_m, 0.0025)
        if right_m > PAPER.max_m:
            right = RangeReading(RangeState.NOTHING)
        estimator.see(RangeScan(time_s, {Beam.FRONT: front, Beam.RIGHT: right}))
        estimator.improve(time_s)


def test_the_filters_go_on_where_the_smoother_ends() -> None:
    estimator = Estimator(0.0, PAPER, 0.0)
    fly_east(estimator, PERIOD_S + 2.5, seed=1)
    pose = estimator.pose(0.0)
    assert pose.reset_counter >= 1
    assert pose.north_m == pytest.approx(0.0, abs=4 * pose.position_sigma_m)
    assert pose.east_m == pytest.approx(6.5, abs=4 * pose.position_sigma_m)
    wall = min(estimator.wall_lines(), key=lambda line: abs(line.normal_rad))
    assert wall.offset_m == pytest.approx(1.5, abs=0.03)


def test_a_wall_is_as_exact_as_it_claims() -> None:
    """Error in sigmas over seeds, odometry and ranges being as noisy as modelled."""
    errors = []
    for seed in range(20):
        estimator = Estimator(0.0, PAPER, 0.0)
        fly_east(estimator, 4.0, seed)
        smoothed = estimator.smoothed()
        assert smoothed is not None
        (wall,) = smoothed.walls
        error_m = wall.offset_m - wall.anchor_m * math.tan(wall.normal_rad) - 1.5
        errors.append(error_m / wall.sigma_m)
    assert 0.5 < float(np.sqrt(np.mean(np.square(errors)))) < 1.5


def test_the_heading_is_as_exact_as_it_claims() -> None:
    mean, low, high = consistency(seeds=8)
    assert 0.9 * low < mean < 1.1 * high

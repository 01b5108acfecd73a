"""Parts of the smoother: equations, noise, walls, and the restart of the filters."""

import math
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.mapping.yaw_consistency import consistency
from companion.core.messages import (
    BEARING_FRD_RAD,
    Beam,
    GyroSample,
    Odometry,
    Pose,
    RangeModel,
    RangeReading,
    RangeScan,
    RangeState,
    RangeUnit,
)
from companion.drivers.chips.sample_clock import SampleClock
from companion.drivers.chips.sharp import GP2Y0A710K0F, PAPER
from companion.estimation.association.association import Association
from companion.estimation.association.gating import Gate
from companion.estimation.association.pruning import Support
from companion.estimation.estimator import Estimator
from companion.estimation.smoothing.bordered_solver import BorderedSystem
from companion.estimation.smoothing.flight_record import FlightRecord
from companion.estimation.smoothing.odometry_model import OdometryModel
from companion.estimation.smoothing.range_noise import BEAMS, RangeUnits
from companion.estimation.smoothing.sliding_window import PERIOD_S
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import Measured, Unknowns
from tests.examples import examples


@pytest.mark.parametrize("begins", [(0,), (0, 6)])
@settings(deadline=None)
@given(seed=st.integers(0, 10_000))
def test_the_bordered_system_solves_least_squares(seed: int, begins: tuple[int, ...]) -> None:
    """Twelve chained and three shared unknowns: step and covariance equal the dense solution.

    With two beginnings, nothing couples the first six chained unknowns with the others.
    """
    random = np.random.default_rng(seed)
    chained, shared, rows = 12, 3, 40
    system = BorderedSystem(chained, shared, 4, begins)
    jacobian, residual = np.zeros((rows, chained + shared)), random.normal(size=rows)
    for row in range(rows):
        first = row % (chained - 3) if len(begins) == 1 else row % 3 + 6 * (row % 2)
        places = [first, first + 3]
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
    if len(begins) > 1:
        return
    factor = solution.samples_of_last(np.eye(chained + shared))
    of_chain = np.linalg.inv(information)[:chained, :chained]
    assert factor @ factor.T == pytest.approx(of_chain, abs=1e-6)
    marginal = system.marginal_of_last(2)
    assert marginal.information @ expected == pytest.approx(np.eye(len(last)), abs=1e-6)
    mean = -np.linalg.solve(marginal.information, marginal.gradient)
    assert mean == pytest.approx(step[last], abs=1e-6)


@pytest.mark.parametrize("sensor", [PAPER, GP2Y0A710K0F])
def test_the_noise_of_the_signal_is_the_same_at_any_distance(sensor: RangeModel) -> None:
    units = level(sensor)
    front = np.array([BEAMS.index(Beam.FRONT)])
    for distance_m in (1.25, 2.15, 4.25):
        near, far = np.array([distance_m - 0.01]), np.array([distance_m + 0.01])
        signals = float((units.signal(front, far) - units.signal(front, near))[0])
        assert signals == pytest.approx(0.02 / float(units.sigma_m(front, near)[0]), rel=0.05)


def level(model: RangeModel) -> RangeUnits:
    return RangeUnits({b: RangeUnit(model, at, 0.0) for b, at in BEARING_FRD_RAD.items()})


def hits_on_a_wall(seed: int, sigma_m: float = 0.05) -> Measured:
    """A flight 4 m east along a wall 1.5 m north, with eight hits in each keyframe."""
    random, record = Random(seed), FlightRecord()
    front = BEAMS.index(Beam.FRONT)
    for k in range(21):
        pose = Pose(0.2 * k, 0.0, 0.2 * k, -1.2, 0.0)
        record.advance(pose, (0.0, 0.2 * k), 0.0)
        for _ in range(8):
            record.add_hit(pose, front, 1.5 + random.gauss(0, sigma_m), ((0.0, 0.0), 0.0), None)
    return Measured.of(record, level(PAPER))


def east_flight(walls: list[tuple[float, float]]) -> Unknowns:
    x = Unknowns.at(np.array([(0.0, 0.2 * k, 0.0) for k in range(21)]), 0.0)
    x.add_walls(np.array(walls), np.tile([-10.0, 10.0], (len(walls), 1)))
    return x


@pytest.mark.parametrize(
    "other", [(0.0, 1.58), (math.radians(4), 1.45), (math.radians(60), 2.0), (math.pi, 1.5)]
)
def test_two_lines_through_the_hits_of_one_wall_become_one_wall(other: tuple[float, float]) -> None:
    x = east_flight([(0.0, 1.5), other])
    association = Association(level(PAPER), OdometryModel(), Support())
    wall_of = association.associate(x, hits_on_a_wall(1), Gate(0.1))
    assert len(x.walls) == 1
    assert x.walls[0] == pytest.approx((0.0, 1.5), abs=0.03)
    assert (wall_of == 0).mean() > 0.95


@settings(deadline=None, max_examples=examples(30))
@given(st.floats(-0.02, 0.02), st.floats(0, 0.008))
def test_gyro_samples_are_stamped_with_their_sampling_time(
    clock_error: float, phase_s: float
) -> None:
    period_s = (1 + clock_error) / 119
    clock, taken = SampleClock(0.0, 119.0), 0
    late_s: list[float] = []
    for tick in range(1, 400):
        now_s = 0.05 * tick
        count = int((now_s - phase_s) / period_s) - taken
        taken += count
        late_s.append(clock.stamp(now_s, count)[-1] - (taken * period_s + phase_s))
    assert max(map(abs, late_s[100:])) < period_s


def fly_east(estimator: Estimator, seconds: float, seed: int) -> None:
    """Fly east at 1 m/s past a wall 1.5 m north, towards a wall 9 m east, with noise."""
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


def test_the_filters_restart_from_the_smoothers_result() -> None:
    estimator = Estimator(0.0, level(PAPER).units)
    fly_east(estimator, PERIOD_S + 2.5, seed=1)
    pose = estimator.pose(0.0)
    assert pose.reset_counter >= 1
    assert pose.north_m == pytest.approx(0.0, abs=4 * pose.position_sigma_m)
    assert pose.east_m == pytest.approx(6.5, abs=4 * pose.position_sigma_m)
    wall = min(estimator.wall_lines(), key=lambda line: abs(line.normal_rad))
    assert wall.offset_m == pytest.approx(1.5, abs=0.03)


def test_wall_errors_are_consistent_with_their_sigma() -> None:
    """Errors in sigmas over seeds, with odometry and range noise as modelled."""
    errors = []
    for seed in range(20):
        estimator = Estimator(0.0, level(PAPER).units)
        fly_east(estimator, 4.0, seed)
        smoothed = estimator.smoothed()
        assert smoothed is not None
        (wall,) = smoothed.walls
        error_m = wall.offset_m - wall.anchor_m * math.tan(wall.normal_rad) - 1.5
        errors.append(error_m / wall.sigma_m)
    assert 0.5 < float(np.sqrt(np.mean(np.square(errors)))) < 1.5


def test_heading_errors_are_consistent_with_their_sigma() -> None:
    mean, low, high = consistency(seeds=8)
    assert 0.9 * low < mean < 1.1 * high


def test_a_part_with_the_marginal_prior_has_the_solution_of_the_whole_flight() -> None:
    """A flight past a wall, with its first half marginalized."""
    estimator = Estimator(0.0, level(PAPER).units)
    fly_east(estimator, 8.0, seed=3)
    smoother = Smoother(estimator.models, Support())
    whole = Measured.of(estimator.record, estimator.models.ranges)
    x = Unknowns.at(estimator.record.frames[:, 4:7], 0.0)
    start = smoother.from_start(np.zeros(3))
    gates = Gate(0.2, detect_keyframes=100), Gate(0.1)
    estimate = smoother.smooth(x, whole, start, gates)
    prior, _ = smoother.marginalize_before(20, estimate, whole, start)
    again = smoother.smooth(x.since(20), whole.between(20, len(x.poses)), prior, (Gate(0.1),))
    assert again.x.poses[-1, :3] == pytest.approx(x.poses[-1, :3], abs=0.002)
    assert again.x.walls == pytest.approx(x.walls, abs=0.002)
    for part, full in zip(again.wall_lines, estimate.wall_lines, strict=True):
        assert part.sigma_m == pytest.approx(full.sigma_m, rel=0.05)

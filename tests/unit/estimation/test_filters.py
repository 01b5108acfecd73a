"""Heading filter, wall runs and position filter on synthetic motions with ground truth."""

import math
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.messages import (
    BEARING_FRD_RAD,
    Beam,
    GyroSample,
    Odometry,
    RangeModel,
    RangeReading,
    RangeScan,
    RangeState,
    RangeUnit,
)
from companion.drivers.chips.sharp import GP2Y0A710K0F, PAPER
from companion.estimation.estimator import Estimator
from companion.estimation.filters.gyro_rest_calibration import RestCalibration
from companion.estimation.filters.heading_filter import GyroModel, HeadingFilter, WallBearing
from companion.estimation.filters.position_filter import WALLS, LineSlam, Wall
from companion.estimation.filters.wall_runs import RunHit, WallRun
from companion.estimation.smoothing.odometry_model import OdometryModel
from tests.examples import examples


def units_of(model: RangeModel) -> dict[Beam, RangeUnit]:
    """Four level sensors of one model at the drone's centre."""
    return {beam: RangeUnit(model, bearing, 0.0) for beam, bearing in BEARING_FRD_RAD.items()}


def gyro(rate_deg_s: float, seconds: float, start_s: float = 0.0) -> list[GyroSample]:
    return [
        GyroSample(start_s + 0.01 * i, math.radians(rate_deg_s))
        for i in range(round(seconds * 100) + 1)
    ]


def test_heading_integrates_the_gyro_without_its_rest_bias() -> None:
    heading = HeadingFilter(math.radians(2.0))
    heading.predict(gyro(47.0, 2.0))
    assert math.degrees(heading.yaw_rad) == pytest.approx(90, abs=0.1)


@settings(deadline=None)
@given(st.floats(-0.05, 0.05), st.floats(-0.3, 0.3))
def test_a_wall_measured_again_after_a_full_turn_determines_the_gyro_scale(
    scale: float, bias: float
) -> None:
    """A full turn takes 8 s and the wall does not move."""
    model = GyroModel(bias_sigma_rad_s=math.radians(0.01))
    heading = HeadingFilter(math.radians(bias), model)
    wall = heading.add_wall(WallBearing(0.2, math.radians(0.3), 0.0, 0.0))
    heading.predict(gyro(45.0 * (1 + scale) + bias, 8.0))
    observed = WallBearing(0.2 - math.tau, math.radians(0.3), 0.0, 0.0)
    heading.correct_by_wall(wall, observed)
    assert math.degrees(heading.yaw_rad) == pytest.approx(0, abs=1.0)
    assert heading.scale_error == pytest.approx(scale / (1 + scale), abs=0.004)


def test_an_implausible_wall_direction_is_rejected() -> None:
    heading = HeadingFilter(0.0)
    wall = heading.add_wall(WallBearing(0.0, math.radians(0.5), 0.0, 0.0))
    assert not heading.correct_by_wall(wall, WallBearing(math.radians(20), 0.01, 0.0, 0.0))
    assert heading.yaw_rad == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("turns", [1, 3, 11])
def test_heading_wraps(turns: int) -> None:
    heading = HeadingFilter(0.0)
    heading.predict(gyro(90.0, 4.0 * turns))
    assert -math.pi <= heading.yaw_rad < math.pi
    assert math.degrees(heading.yaw_rad) == pytest.approx(0, abs=0.5)


def test_rest_calibration_waits_until_the_drone_is_still() -> None:
    rest = RestCalibration(2.0)
    rest.add(gyro(0.5, 1.5))
    rest.add(gyro(30.0, 0.5, start_s=1.5))
    assert rest.bias_rad_s is None
    rest.add(gyro(0.5, 2.5, start_s=2.1))
    assert rest.bias_rad_s == pytest.approx(math.radians(0.5), abs=1e-6)


def test_rest_calibration_repeats_while_the_drone_stands() -> None:
    """The bias is that of the last seconds, because a gyro drifts while it warms up."""
    rest = RestCalibration(2.0)
    assert not rest.add(gyro(0.5, 1.5))
    assert rest.add(gyro(0.5, 1.0, start_s=1.5))
    assert rest.add(gyro(0.8, 4.5, start_s=2.5))
    assert rest.bias_rad_s == pytest.approx(math.radians(0.8), abs=1e-6)


def run_along(normal_deg: float, sigma_m: float, seed: int) -> tuple[float, float]:
    """Hits along a wall 1.5 m away; returns direction error and estimated sigma, degrees."""
    random = Random(seed)
    run = WallRun()
    normal = math.radians(normal_deg)
    for i in range(400):
        along = 0.05 * i
        origin_ne_m = (-along * math.sin(normal), along * math.cos(normal))
        range_m = 1.5 + random.gauss(0, sigma_m)
        hit = (
            origin_ne_m[0] + range_m * math.cos(normal),
            origin_ne_m[1] + range_m * math.sin(normal),
        )
        line = run.add(RunHit(0.05 * i, hit, sigma_m**2, origin_ne_m, 0.0))
        if line:
            error = math.degrees(math.remainder(line.normal_rad - normal, math.tau))
            return error, math.degrees(line.normal_sigma_rad)
    pytest.fail("no run was finished")


@settings(max_examples=examples(40))
@given(st.floats(-180, 180), st.sampled_from([0.01, 0.05]), st.integers(0, 10_000))
def test_the_direction_error_of_a_run_is_consistent_with_its_sigma(
    normal_deg: float, sigma_m: float, seed: int
) -> None:
    error_deg, sigma_deg = run_along(normal_deg, sigma_m, seed)
    assert abs(error_deg) < 5 * sigma_deg
    assert sigma_deg < 2.0


def test_noise_along_the_beam_forms_no_wall() -> None:
    random = Random(3)
    run = WallRun()
    for i in range(200):
        hit = (4.0 + random.gauss(0, 0.3), 0.0)
        assert run.add(RunHit(0.05 * i, hit, 0.3**2, (0.0, 0.0), 0.0)) is None
    assert run.end() is None


def corridor(estimator: Estimator, scale: float, noise: Random, sigma_m: float) -> float:
    """Fly 4 m east towards a wall at 6 m, facing a wall 1.5 m north.

    Returns the final true east.
    """
    estimator.turn([GyroSample(0.0, 0.0)])
    east = 0.0
    for tick in range(1, 81):
        time_s = 0.05 * tick
        east += 0.05
        estimator.turn([GyroSample(time_s, 0.0)])
        estimator.move(Odometry(time_s, (0.0, east * scale, -1.2), (0.0, scale, 0.0), yaw_rad=0.0))
        readings = {
            Beam.FRONT: RangeReading(RangeState.DISTANCE, 1.5 + noise.gauss(0, sigma_m), 0.0025),
            Beam.RIGHT: RangeReading(
                RangeState.DISTANCE, 6.0 - east + noise.gauss(0, sigma_m), 0.0025
            )
            if 6.0 - east < 4.8
            else RangeReading(RangeState.NOTHING),
        }
        estimator.see(RangeScan(time_s, readings))
    return east


def test_the_pose_follows_odometry_without_walls() -> None:
    estimator = Estimator(0.0, units_of(PAPER))
    estimator.move(Odometry(0.0, (5.0, 5.0, 0.0), (0.0, 0.0, 0.0), 1.0))
    estimator.move(Odometry(0.1, (5.0, 5.5, -0.1), (0.0, 0.0, 0.0), 1.0))
    pose = estimator.pose(0.1)
    assert math.hypot(pose.north_m, pose.east_m) == pytest.approx(0.5)
    assert pose.height_m == pytest.approx(0.1)


def test_the_facing_wall_is_mapped_at_its_distance() -> None:
    estimator = Estimator(0.0, units_of(PAPER))
    corridor(estimator, 1.0, Random(1), 0.02)
    ahead = estimator.wall_ahead(0.0)
    assert ahead is not None
    normal_rad, distance_m = ahead
    assert math.degrees(normal_rad) == pytest.approx(0, abs=1)
    assert distance_m == pytest.approx(1.5, abs=0.03)


def test_the_map_before_the_first_measurement_has_no_walls() -> None:
    assert not Estimator(0.0, units_of(GP2Y0A710K0F)).so_far().walls


def test_the_smoother_returns_no_map_without_measurements() -> None:
    assert Estimator(0.0, units_of(GP2Y0A710K0F)).smoothed() is None
    estimator = Estimator(0.0, units_of(PAPER))
    corridor(estimator, 1.0, Random(1), 0.02)
    smoothed = estimator.smoothed()
    assert smoothed is not None
    assert len(smoothed.walls) == 1
    assert smoothed.walls[0].offset_m == pytest.approx(1.5, abs=0.03)


# Correction by single ranges


NORTH = 0.0


def before_walls(*offsets_m: float, position_sigma_m: float = 0.16) -> LineSlam:
    """A filter at the origin, facing walls at these distances, each with a sigma of 1 cm."""
    heading = HeadingFilter(0.0)
    for _ in offsets_m:
        heading.add_wall(WallBearing(NORTH, math.radians(0.5), 0.0, 0.0))
    slam = LineSlam(heading, OdometryModel())
    sigmas_m = [position_sigma_m] * 2 + [0.01] * (WALLS - 2 + len(offsets_m))
    walls = [Wall(i, (ahead_m, 0.0), -3.0, 3.0) for i, ahead_m in enumerate(offsets_m)]
    slam.restart(np.zeros(WALLS + len(walls)), np.diag(np.square(sigmas_m)), walls)
    return slam


def estimated_north_m(slam: LineSlam, range_m: float, times: int = 1) -> float:
    """Estimated north after `times` ranges straight ahead, m."""
    unit = RangeUnit(GP2Y0A710K0F, NORTH, 0.0)
    for _ in range(times):
        slam.correct_by_range(slam.position_ne_m, NORTH, range_m, unit)
    return slam.position_ne_m[0]


@given(st.floats(0.3, 0.45))
def test_one_range_to_another_obstacle_shifts_the_position_by_less_than_half_its_error(
    error_m: float,
) -> None:
    assert abs(estimated_north_m(before_walls(3.0), 3.0 - error_m)) < 0.45 * error_m


@given(st.floats(-0.3, 0.3))
def test_consistent_ranges_correct_the_position(error_m: float) -> None:
    assert estimated_north_m(before_walls(3.0), 3.0 - error_m, times=20) == pytest.approx(
        error_m, abs=0.05
    )


def test_a_range_that_fits_an_uninformative_wall_does_not_correct_a_nearer_one() -> None:
    assert estimated_north_m(before_walls(4.5), 5.05) != 0
    assert estimated_north_m(before_walls(4.5, 5.2), 5.05) == 0

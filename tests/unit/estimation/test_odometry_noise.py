"""Estimation of the odometry's wander from the ranges to known walls."""

import math
from random import Random

import numpy as np
import pytest

from companion.core.arrays import Array
from companion.estimation.filters.heading_filter import HeadingFilter
from companion.estimation.filters.position_filter import LineSlam
from companion.estimation.filters.wall_runs import Line, RunHit, WallRun
from companion.estimation.smoothing.odometry_model import (
    MIN_WANDER_M,
    WANDER_S,
    OdometryModel,
    averaged,
)
from companion.estimation.smoothing.odometry_noise import OdometryNoise
from sitl.autopilot.estimation.velocity_error import KICK_S, VelocityError

TICK_S, WALL_M, RANGE_SIGMA_M = 0.05, 2.0, 0.02


def estimated_wander_m(wander_m: float, wall: int | None = 0) -> float:
    """Estimated sigma of the wander after two minutes beside a wall to the north."""
    model, random = OdometryModel(), Random(1)
    noise, wander = OdometryNoise(model), 0.0
    kept = math.exp(-TICK_S / WANDER_S)
    for tick in range(2400):
        wander = kept * wander + random.gauss(0, wander_m * math.sqrt(1 - kept**2))
        north_m = WALL_M + wander + random.gauss(0, RANGE_SIGMA_M)
        noise.add_hit(0, wall, tick * TICK_S, ((north_m, 0.0), 0.0, RANGE_SIGMA_M**2))
    return model.wander_m


def test_the_wander_of_exact_odometry_is_below_one_centimetre() -> None:
    assert estimated_wander_m(0.0) < 0.01


@pytest.mark.parametrize("wander_m", [0.05, 0.1])
def test_the_wander_is_estimated_from_ranges_to_a_wall(wander_m: float) -> None:
    assert estimated_wander_m(wander_m) == pytest.approx(wander_m, rel=0.35)


def test_hits_without_a_known_wall_do_not_change_the_wander() -> None:
    assert estimated_wander_m(0.1, wall=None) == MIN_WANDER_M


@pytest.mark.parametrize("minutes", [0.5, 5])
def test_the_wander_does_not_grow_with_time(minutes: float) -> None:
    """Only the random walk grows with time."""
    slam = LineSlam(HeadingFilter(0.0), model := OdometryModel(wander_m=0.07))
    for _ in range(int(minutes * 60 / TICK_S)):
        slam.move((0.0, 0.0), TICK_S)
    walked_m = math.sqrt(model.step_variance_m2_per_s * 60 * minutes)
    assert slam.position_sigma_m == pytest.approx(math.hypot(walked_m, 0.07), rel=0.01)


def test_the_estimated_wander_matches_the_emulated_autopilots_position_error() -> None:
    """The emulated error oscillates and the model only decays; both agree over a second."""
    wobble, random = VelocityError(Random(2), 0.1, 1.0, 1.5), Random(3)
    model = OdometryModel()
    noise, offs_m = OdometryNoise(model), []
    for step in range(12_000):
        if step % round(KICK_S / 0.01) == 0:
            wobble.kick()
        wobble.step(0.01)
        if step % 5 == 0:
            offs_m.append(wobble.position_m)
            north_m = WALL_M + wobble.position_m + random.gauss(0, RANGE_SIGMA_M)
            noise.add_hit(0, 0, step * 0.01, ((north_m, 0.0), 0.0, RANGE_SIGMA_M**2))
    assert model.wander_m == pytest.approx(float(np.std(offs_m)), rel=0.35)


@pytest.mark.parametrize("speed_m_s", [0.4, 2.0])
@pytest.mark.parametrize("wander_m", [0.02, 0.07])
def test_the_direction_sigma_of_a_run_includes_the_wander(
    speed_m_s: float, wander_m: float
) -> None:
    """Errors that all hits share do not average out."""
    kept, random = math.exp(-TICK_S / WANDER_S), Random(4)
    errors_sigmas = []
    for _ in range(120):
        run, line, wander, tick = WallRun(), None, random.gauss(0, wander_m), 0
        run.MAX_NORMAL_SIGMA_RAD = math.radians(30)
        while line is None and tick < 400:
            wander = kept * wander + random.gauss(0, wander_m * math.sqrt(1 - kept**2))
            at = speed_m_s * tick * TICK_S, WALL_M + wander + random.gauss(0, RANGE_SIGMA_M)
            hit = RunHit(tick * TICK_S, at, RANGE_SIGMA_M**2, (at[0], 0.0), 0.0, wander_m=wander_m)
            line, tick = run.add(hit), tick + 1
        if isinstance(line, Line):
            errors_sigmas.append((line.normal_rad - math.pi / 2) / line.normal_sigma_rad)
    assert len(errors_sigmas) > 80
    assert 0.4 < float(np.std(errors_sigmas)) < 1.4


def legs_and_stops(wobble_m_s: float, scale: float) -> tuple[Array, Array]:
    """True and reported steps of 0.2 s, (n, 2) each, m: ten minutes of 8 s legs and stops.

    The autopilot follows its estimate, so an error of the estimate moves the drone the other way,
    with a lag.
    """
    wobble, random = VelocityError(Random(4), wobble_m_s, 1.0, 1.5), Random(5)
    steps_m, response_m_s = [], 0.0
    for tick in range(60_000):
        if tick % round(KICK_S / 0.01) == 0:
            wobble.kick()
        wobble.step(0.01)
        leg = tick // 1000
        flown_m_s = (0.8 if leg % 2 else -0.8) if tick % 1000 < 800 else 0.0
        response_m_s += (wobble.velocity_m_s - response_m_s) * 0.01 / 0.3
        true_m_s = (flown_m_s - response_m_s) / scale
        steps_m.append((0.01 * true_m_s, 0.01 * (scale * true_m_s + wobble.velocity_m_s)))
    true_m, reported_m = np.array(steps_m).reshape(-1, 20, 2).sum(axis=1).T
    noise_m = np.array([random.gauss(0, 0.007) for _ in reported_m])
    return np.column_stack([true_m, 0 * true_m]), np.column_stack(
        [reported_m + noise_m, 0 * reported_m]
    )


@pytest.mark.parametrize("wobble_m_s", [0.0, 0.05, 0.1])
def test_the_scale_from_averaged_motion_has_no_bias_from_velocity_errors(
    wobble_m_s: float,
) -> None:
    """The unaveraged reported motion would give a scale error of some per cent."""
    true_m, reported_m = legs_and_stops(wobble_m_s, scale=1.03)
    still = np.zeros(len(reported_m))
    mean_m = averaged(np.full(len(reported_m), 0.2), reported_m, still)
    assert (mean_m * true_m).sum() / (mean_m * reported_m).sum() == pytest.approx(
        1 / 1.03, rel=0.004
    )


@pytest.mark.parametrize("turn_rad", [0.0, 0.05, -0.4])
def test_averaged_motion_is_in_the_body_frame_of_each_step(
    turn_rad: float,
) -> None:
    """The drone flies straight and turns, so its mean motion equals that of each step."""
    steps = 60
    yaw_rad = turn_rad * np.arange(steps)
    straight_m = 0.1 * np.column_stack([np.cos(yaw_rad), -np.sin(yaw_rad)])
    mean_m = averaged(np.full(steps, 0.2), straight_m, np.full(steps, turn_rad))
    inner = slice(10, -10)
    assert mean_m[inner] == pytest.approx(straight_m[inner], abs=1e-9)

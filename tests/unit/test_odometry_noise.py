"""How far the odometry wanders is learnt from the ranges to known walls."""

import math
from random import Random

import numpy as np
import pytest

from companion.drivers.sharp import PAPER
from companion.estimation.factors import Models
from companion.estimation.flight_record import FlightRecord
from companion.estimation.heading import HeadingFilter
from companion.estimation.line_slam import LineSlam
from companion.estimation.odometry_model import (
    LEAST_WANDER_M,
    WANDER_S,
    OdometryModel,
)
from companion.estimation.odometry_noise import OdometryNoise
from companion.estimation.range_units import BEAMS, RangeUnits
from companion.estimation.smoother import Smoother
from companion.estimation.support import Support
from companion.estimation.unknowns import Measured, Unknowns
from companion.estimation.wall_runs import Line, RunHit, WallRun
from companion.messages import BEARING_FRD_RAD, Beam, Pose, RangeUnit
from sitl.autopilot.wobble import KICK_S, Wobble

TICK_S, WALL_M, RANGE_SIGMA_M = 0.05, 2.0, 0.02
FAR_M = 7.5
LEVEL = RangeUnits({b: RangeUnit(PAPER, at, 0.0) for b, at in BEARING_FRD_RAD.items()})


def learnt(wander_m: float, wall: int | None = 0) -> float:
    """Sigma of the wander, beside a wall to the north for two minutes."""
    model, random = OdometryModel(), Random(1)
    noise, wander = OdometryNoise(model), 0.0
    kept = math.exp(-TICK_S / WANDER_S)
    for tick in range(2400):
        wander = kept * wander + random.gauss(0, wander_m * math.sqrt(1 - kept**2))
        north_m = WALL_M + wander + random.gauss(0, RANGE_SIGMA_M)
        noise.see(0, wall, tick * TICK_S, ((north_m, 0.0), 0.0, RANGE_SIGMA_M**2))
    return model.wander_m


def test_odometry_that_does_not_err_keeps_the_reference() -> None:
    assert learnt(0.0) < 0.01


@pytest.mark.parametrize("wander_m", [0.05, 0.1])
def test_a_wandering_estimate_is_noticed_and_measured(wander_m: float) -> None:
    assert learnt(wander_m) == pytest.approx(wander_m, rel=0.35)


def test_hits_of_no_known_wall_tell_nothing() -> None:
    assert learnt(0.1, wall=None) == LEAST_WANDER_M


@pytest.mark.parametrize("minutes", [0.5, 5])
def test_what_wanders_does_not_drift_away(minutes: float) -> None:
    """Only the walk grows with time."""
    slam = LineSlam(HeadingFilter(0.0), model := OdometryModel(wander_m=0.07))
    for _ in range(int(minutes * 60 / TICK_S)):
        slam.move((0.0, 0.0), TICK_S)
    walked_m = math.sqrt(model.step_variance_m2_per_s * 60 * minutes)
    assert slam.position_sigma_m == pytest.approx(math.hypot(walked_m, 0.07), rel=0.01)


def test_the_position_error_that_autopilots_make_is_of_the_size_that_is_learnt() -> None:
    """The emulated error swings, the model only fades: within a second they must agree."""
    wobble, random = Wobble(Random(2), 0.1, 1.0, 1.5), Random(3)
    model = OdometryModel()
    noise, offs_m = OdometryNoise(model), []
    for step in range(12_000):
        if step % round(KICK_S / 0.01) == 0:
            wobble.kick()
        wobble.step(0.01)
        if step % 5 == 0:
            offs_m.append(wobble.position_m)
            north_m = WALL_M + wobble.position_m + random.gauss(0, RANGE_SIGMA_M)
            noise.see(0, 0, step * 0.01, ((north_m, 0.0), 0.0, RANGE_SIGMA_M**2))
    assert model.wander_m == pytest.approx(float(np.std(offs_m)), rel=0.35)


@pytest.mark.parametrize("speed_m_s", [0.4, 2.0])
@pytest.mark.parametrize("wander_m", [0.02, 0.07])
def test_a_run_of_hits_knows_how_sure_its_direction_is(speed_m_s: float, wander_m: float) -> None:
    """Errors that hits have in common do not average out."""
    kept, random = math.exp(-TICK_S / WANDER_S), Random(4)
    sigmas_off = []
    for _ in range(120):
        run, line, wander, tick = WallRun(), None, random.gauss(0, wander_m), 0
        run.MOST_NORMAL_SIGMA_RAD = math.radians(30)
        while line is None and tick < 400:
            wander = kept * wander + random.gauss(0, wander_m * math.sqrt(1 - kept**2))
            at = speed_m_s * tick * TICK_S, WALL_M + wander + random.gauss(0, RANGE_SIGMA_M)
            hit = RunHit(tick * TICK_S, at, RANGE_SIGMA_M**2, (at[0], 0.0), 0.0, wander_m=wander_m)
            line, tick = run.add(hit), tick + 1
        if isinstance(line, Line):
            sigmas_off.append((line.normal_rad - math.pi / 2) / line.normal_sigma_rad)
    assert len(sigmas_off) > 80
    assert 0.4 < float(np.std(sigmas_off)) < 1.4


def flown_to_and_fro(seed: int, scale: float) -> tuple[Unknowns, Measured]:
    """Four minutes to and fro before a wall, met from 1.5 to 5 m; the estimate wanders by 7 cm.

    The poses are as told; the wall is where it is.
    """
    wobble, random = Wobble(Random(seed), 0.12, 1.0, 1.5), Random(100 + seed)
    record = FlightRecord()
    north_m = walked_m = told_m = 0.0
    for tick in range(4800):
        pose = Pose(tick * TICK_S, told_m, 0.0, -1.2, 0.0)
        record.advance(pose, (told_m, 0.0), 0.0)
        if (away_m := FAR_M - north_m) < PAPER.max_m:
            measured_m = away_m + random.gauss(0, RANGE_SIGMA_M)
            record.add_hit(pose, BEAMS.index(Beam.FRONT), measured_m, ((0.0, 0.0), 0.0), 0)
        for step in range(5):
            if (5 * tick + step) % round(KICK_S / 0.01) == 0:
                wobble.kick()
            wobble.step(0.01)
        leg, in_leg = divmod(tick, 200)
        north_m += (0.0375 if leg % 2 == 0 else -0.0375) if in_leg < 160 else 0.0
        walked_m += random.gauss(0, 0.003)
        told_m = north_m * scale + wobble.position_m + walked_m
    x = Unknowns.at(record.frames[:, 4:7], 0.0)
    x.add_walls(np.array([(0.0, FAR_M)]), np.array([(-1.0, 1.0)]))
    return x, Measured.of(record, LEVEL)


def test_what_the_told_motion_errs_does_not_bias_the_scale() -> None:
    models = Models(LEVEL, odometry=OdometryModel(wander_m=0.07))
    smoother, off = Smoother(models, Support()), []
    for seed in range(8):
        x, m = flown_to_and_fro(seed, scale=1.03)
        on_the_wall = np.zeros(len(m.frame), dtype=np.int64)
        for _ in range(5):
            smoother.step(x, m, on_the_wall, smoother.from_start(np.zeros(3)))
        off.append((1 + x.odometry_scale) * 1.03 - 1)
    assert float(np.mean(off)) == pytest.approx(0.0, abs=0.005)

"""Change of our gyro's bias, with the more stable autopilot gyro as reference."""

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.core.arrays import Array
from companion.estimation.filters.heading_filter import GyroModel
from companion.estimation.smoothing.state import Measured
from companion.estimation.smoothing.two_gyro_bias import AutopilotGyroModel, aided

STEP_S, KEYFRAMES = 0.2, 1500
OWN_SCALE, AUTOPILOT_SCALE, AUTOPILOT_BIAS_DEG_S = 1.02, 0.99, 0.1


def flight(bias_deg_s: Array, compass_deg: Array | float = 0.0) -> Measured:
    """Five minutes of turns to both sides with a trend to the right; our gyro has this bias."""
    time_s: Array = STEP_S * np.arange(KEYFRAMES, dtype=np.float64)
    yaw_deg = 3 * time_s + 45 * np.sin(time_s)
    noise = np.random.default_rng(1).normal(0, 1, (2, KEYFRAMES))
    own_deg = OWN_SCALE * np.diff(yaw_deg) + STEP_S * bias_deg_s[:-1] + 0.009 * noise[0, 1:]
    autopilot_deg = (
        AUTOPILOT_SCALE * yaw_deg + AUTOPILOT_BIAS_DEG_S * time_s + compass_deg + 0.2 * noise[1]
    )
    nothing, none = np.empty(0), np.empty(0, dtype=np.int64)
    return Measured(
        dt_s=np.full(KEYFRAMES - 1, STEP_S),
        age_s=10 + time_s[1:],
        moved_frd_m=np.zeros((KEYFRAMES - 1, 2)),
        turned_rad=np.radians(own_deg),
        autopilot_yaw_rad=np.radians(autopilot_deg),
        bias_moved_rad_s=np.zeros(KEYFRAMES - 1),
        is_aided=np.zeros(KEYFRAMES - 1, dtype=bool),
        frame=none,
        beam=none,
        offset_frd_m=np.empty((0, 2)),
        bearing_rad=nothing,
        distance_m=nothing,
        mount_m=nothing,
        averaged_frd_m=np.zeros((KEYFRAMES - 1, 2)),
    )


def wandering(seed: int) -> Array:
    """Random walk as of an LSM9DS1, deg/s: a tenth of a degree per second after some minutes."""
    steps = np.random.default_rng(seed).normal(0, 0.008 * math.sqrt(STEP_S), KEYFRAMES)
    return np.cumsum(steps)


@pytest.mark.parametrize("seed", range(4))
def test_the_estimated_change_of_the_bias_keeps_the_heading_over_minutes(seed: int) -> None:
    bias_deg_s = wandering(seed)
    m = aided(flight(bias_deg_s), GyroModel(), AutopilotGyroModel())
    assert m.is_aided.all()
    moved_deg_s = np.degrees(np.cumsum(m.bias_moved_rad_s))
    off_deg_s = moved_deg_s - (bias_deg_s[1:] - bias_deg_s[0])
    heading_off_deg = np.cumsum(STEP_S * (off_deg_s - off_deg_s.mean()))
    alone_off_deg = np.cumsum(STEP_S * (bias_deg_s - bias_deg_s.mean()))
    assert np.std(heading_off_deg) < 0.3
    assert np.std(heading_off_deg) < 0.2 * np.std(alone_off_deg)


def test_a_heading_that_a_compass_resets_is_not_used() -> None:
    disturbed_deg = 8 * np.sin(0.7 * STEP_S * np.arange(KEYFRAMES))
    m = flight(wandering(0), disturbed_deg)
    assert aided(m, GyroModel(), AutopilotGyroModel()) is m


def test_the_bias_change_is_not_estimated_without_a_reported_heading() -> None:
    m = flight(wandering(0))
    unreported = replace(m, autopilot_yaw_rad=np.full(KEYFRAMES, np.nan))
    assert aided(unreported, GyroModel(), AutopilotGyroModel()) is unreported


def test_a_gap_in_the_reported_heading_is_bridged() -> None:
    bias_deg_s = wandering(2)
    m = flight(bias_deg_s)
    autopilot_yaw_rad = m.autopilot_yaw_rad.copy()
    autopilot_yaw_rad[:40] = autopilot_yaw_rad[700:750] = np.nan
    m = aided(replace(m, autopilot_yaw_rad=autopilot_yaw_rad), GyroModel(), AutopilotGyroModel())
    assert not m.is_aided[:40].any()
    assert m.is_aided[40:].all()
    moved_deg_s = np.degrees(m.bias_moved_rad_s[40:].sum())
    assert moved_deg_s == pytest.approx(bias_deg_s[-1] - bias_deg_s[40], abs=0.06)

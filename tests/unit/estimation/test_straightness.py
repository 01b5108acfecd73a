"""Hits along a wall with a bend or a step are distinguished from those along a straight wall."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.estimation.association.straightness import bend, longer_side

SIGMA_M = 0.05
LENGTH_M = 4.0


def along_m(hits: int = 400) -> np.ndarray:
    return np.linspace(-LENGTH_M / 2, LENGTH_M / 2, hits)


def noise_m(seed: int, hits: int = 400) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, SIGMA_M, hits)


def fitted_m(across_m: np.ndarray) -> np.ndarray:
    """Residuals from the least-squares line, m."""
    return across_m - np.polyval(np.polyfit(along_m(), across_m, 1), along_m())


@given(st.integers(0, 2**32 - 1), st.floats(-0.1, 0.1))
def test_a_straight_wall_is_straight_in_any_direction(seed: int, slope: float) -> None:
    across_m = slope * along_m() + noise_m(seed)
    assert bend(along_m(), across_m, np.full(400, SIGMA_M)).is_straight


@pytest.mark.parametrize("at_m", [-1.0, 0.0, 0.7])
@pytest.mark.parametrize("bend_deg", [-16.0, 10.0])
def test_a_wall_with_a_bend_is_cut_at_the_bend(at_m: float, bend_deg: float) -> None:
    behind_m = np.maximum(along_m() - at_m, 0.0)
    across_m = fitted_m(math.tan(math.radians(bend_deg)) * behind_m + noise_m(1))
    bent = bend(along_m(), across_m, np.full(400, SIGMA_M))
    assert not bent.is_straight
    assert bent.at_m == pytest.approx(at_m, abs=0.5)


def test_a_wall_with_a_step_is_cut_at_the_step_and_the_longer_side_is_kept() -> None:
    across_m = fitted_m(np.where(along_m() > 1.0, 0.2, 0.0) + noise_m(2))
    bent = bend(along_m(), across_m, np.full(400, SIGMA_M))
    assert not bent.is_straight
    kept = longer_side(along_m(), bent.at_m)
    assert along_m()[kept].max() == pytest.approx(1.0, abs=0.3)
    assert kept.sum() > 200


def test_a_bend_to_which_the_trajectory_has_adapted_is_detected_in_noisy_hits() -> None:
    """Two walls of a corridor, bent by 16 degrees, as one wall: each hit is within its noise."""
    sigma_m = 0.09
    along = np.linspace(-2.75, 0.5, 260)
    left_m = np.interp(along, [-2.75, -1.0, 0.5], [0.12, -0.09, 0.06])
    across_m = left_m + np.random.default_rng(3).normal(0.0, sigma_m, len(along))
    assert (np.abs(across_m) < 3 * sigma_m).mean() > 0.98
    bent = bend(along, across_m, np.full(len(along), sigma_m))
    assert not bent.is_straight
    assert bent.at_m == pytest.approx(-1.0, abs=0.5)


def test_a_wall_that_is_too_short_counts_as_straight() -> None:
    assert bend(np.linspace(0, 0.4, 20), np.linspace(0, 0.4, 20), np.full(20, 0.01)).is_straight


def test_a_wall_without_hits_counts_as_straight() -> None:
    assert bend(np.empty(0), np.empty(0), np.empty(0)).is_straight

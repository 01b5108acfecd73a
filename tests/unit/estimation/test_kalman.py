"""Tests the steps of the Kalman filter against their definitions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.arrays import Array
from companion.estimation.filters.kalman import corrected, predicted

SIZE = 4
seeds = st.integers(0, 10**6)


def random_covariance(draw: np.random.Generator) -> Array:
    root = draw.normal(0, 1, (SIZE, SIZE))
    covariance: Array = root @ root.T + 0.01 * np.eye(SIZE)
    return covariance


@given(seeds)
def test_a_correction_adds_the_information_of_the_measurement(seed: int) -> None:
    """The information form: P'⁻¹ = P⁻¹ + h hᵀ / r and P'⁻¹ x' = P⁻¹ x + h z / r."""
    draw = np.random.default_rng(seed)
    x, h, p = draw.normal(0, 1, SIZE), draw.normal(0, 1, SIZE), random_covariance(draw)
    z, r = draw.normal(0, 1), draw.uniform(0.1, 2)
    x_after, p_after = corrected(x, p, h, z, r)
    information = np.linalg.inv(p) + np.outer(h, h) / r
    assert np.linalg.inv(p_after) == pytest.approx(information, rel=1e-6, abs=1e-6)
    weighted = np.linalg.solve(p, x) + h * z / r
    assert information @ x_after == pytest.approx(weighted, rel=1e-6, abs=1e-6)


@given(seeds)
def test_the_covariance_stays_positive_after_measurements_of_any_precision(seed: int) -> None:
    draw = np.random.default_rng(seed)
    x, p = np.zeros(SIZE), random_covariance(draw)
    for exponent in range(-12, 3):
        x, p = corrected(x, p, draw.normal(0, 1, SIZE), draw.normal(0, 1), 10.0**exponent)
        assert p == pytest.approx(p.T, abs=1e-12)
        assert np.linalg.eigvalsh(p).min() > -1e-12


def test_a_prediction_propagates_the_errors_of_the_state() -> None:
    """Position and velocity: after 2 s the position's variance is σ² + (2 s)² σᵥ² + q."""
    f, q = np.array([[1.0, 2.0], [0.0, 1.0]]), np.diag([0.5, 0.0])
    x, p = predicted(np.array([1.0, 3.0]), np.diag([0.1, 0.2]), f, q)
    assert x == pytest.approx([7.0, 3.0])
    assert p[0, 0] == pytest.approx(0.1 + 4 * 0.2 + 0.5)
    assert p[0, 1] == p[1, 0] == pytest.approx(2 * 0.2)

"""Tests of the joint covariance of walls."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from companion.core.arrays import Array
from companion.core.known_walls import KnownWalls

SIGMAS_M = st.floats(0.001, 2.0)


def facing(covariance_m2: Array) -> KnownWalls:
    """A wall 2 m north of the origin, and one 2 m south of it."""
    normals, reach_m = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([[-2.0, 2.0]] * 2)
    return KnownWalls(normals, np.full(2, 2.0), reach_m, covariance_m2, np.full(2, -np.inf))


@given(SIGMAS_M, SIGMAS_M, st.floats(-0.99, 0.99), SIGMAS_M)
def test_a_measurement_makes_walls_and_distances_no_less_certain(
    one_m: float, other_m: float, correlation: float, measured_m: float
) -> None:
    off = correlation * one_m * other_m
    walls = facing(np.array([[one_m**2, off], [off, other_m**2]]))
    after = walls.with_measured(np.array([measured_m, np.inf]))
    assert (after.sigmas_m <= walls.sigmas_m + 1e-9).all()
    assert after.sigmas_m[0] <= min(one_m, measured_m) + 1e-9
    assert (after.gap_sigmas_m() <= walls.gap_sigmas_m() + 1e-6).all()


def test_a_measurement_of_one_wall_improves_those_that_err_with_it() -> None:
    """Behind a doorway all walls are off by the drift of the way there."""
    drift_m2, own_m2 = 0.1**2, 0.01**2
    walls = facing(np.array([[drift_m2 + own_m2, -drift_m2], [-drift_m2, drift_m2 + own_m2]]))
    after = walls.with_measured(np.array([0.01, np.inf]))
    assert after.sigmas_m[1] < 0.02


def test_walls_that_nobody_has_measured_stay_as_they_are() -> None:
    walls = facing(np.diag([0.01, 0.04]))
    assert walls.with_measured(np.full(2, np.inf)) is walls

"""Detection of beams that change to another surface at nearly the same distance."""

import math

import numpy as np
import pytest

from companion.core.arrays import Array
from companion.estimation.association.steps import Steps
from companion.estimation.smoothing.odometry_model import OdometryModel

HITS, SIGMA_M = 120, 0.025
ALL = np.zeros(HITS, dtype=np.int64)
FLIGHTS = 400
PILASTER = slice(40, 75)
NORTH = np.array([[0.0, 2.0]])
"""A wall 2 m to the north."""


def along_a_wall(
    out_m: Array, seed: int, slant_rad: float = 0.0, late_m: Array | None = None
) -> Steps:
    """Hits of a beam along a wall at 0.8 m/s, 20 a second; the wall protrudes by `out_m`, (n,).

    `late_m` is the position error of each hit by late odometry.
    """
    noise_m = SIGMA_M * np.random.default_rng(seed).standard_normal(HITS)
    east_m = 0.04 * np.arange(HITS)
    north_m = 2.0 - out_m + math.tan(slant_rad) * east_m + noise_m
    frame = np.arange(HITS) // 4
    return Steps(
        np.zeros(HITS, dtype=np.int64),
        frame,
        0.2 * frame.astype(np.float64),
        np.column_stack([north_m, east_m]),
        np.full(HITS, SIGMA_M),
        np.zeros(HITS) if late_m is None else late_m,
        OdometryModel(),
    )


def pilaster(depth_m: float) -> Array:
    out_m = np.zeros(HITS)
    out_m[PILASTER] = depth_m
    return out_m


@pytest.mark.parametrize("depth_m", [-0.3, -0.15, 0.15, 0.3])
def test_hits_on_a_pilaster_or_a_recess_are_off_the_surface(depth_m: float) -> None:
    expected = np.zeros(HITS, dtype=bool)
    expected[PILASTER] = True
    off_surface = [
        along_a_wall(pilaster(depth_m), seed).off_surface(ALL, NORTH) for seed in range(FLIGHTS)
    ]
    is_right = [(found != expected).sum() <= 3 for found in off_surface]
    assert sum(is_right) >= 0.98 * FLIGHTS


@pytest.mark.parametrize("slant_deg", [-4, 0, 4])
def test_a_straight_wall_with_an_uncertain_direction_has_no_step(
    slant_deg: float,
) -> None:
    slant_rad = math.radians(slant_deg)
    straight = [along_a_wall(np.zeros(HITS), seed, slant_rad) for seed in range(FLIGHTS)]
    assert sum(steps.off_surface(ALL, NORTH).any() for steps in straight) <= 0.02 * FLIGHTS


def test_hits_without_a_wall_are_never_off_the_surface() -> None:
    assert not along_a_wall(pilaster(0.15), 1).off_surface(np.full(HITS, -1), NORTH).any()


@pytest.mark.parametrize(("depth_m", "apart"), [(0.15, True), (0.0, False)])
def test_a_step_separates_a_wall_and_its_pilaster(depth_m: float, apart: bool) -> None:
    steps = along_a_wall(pilaster(depth_m), seed=1)
    on_it = np.arange(HITS)[PILASTER]
    assert steps.separates(on_it, np.setdiff1d(np.arange(HITS), on_it), 0.0) == apart


def test_a_step_that_late_odometry_explains_is_ignored() -> None:
    """Otherwise odometry 0.4 s late would split a wall into three."""
    late_m = np.zeros(HITS)
    late_m[PILASTER] = 0.08
    straight = [along_a_wall(pilaster(0.1), seed, late_m=late_m) for seed in range(FLIGHTS)]
    assert sum(steps.off_surface(ALL, NORTH).any() for steps in straight) <= 0.02 * FLIGHTS

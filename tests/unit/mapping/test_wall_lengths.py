"""Tests how well the length of a wall is said to be known."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from companion.core.messages import WallSegment
from companion.mapping.wall_lengths import FREE_END_M, length_sigmas_m


def wall(*ends: tuple[float, float], sigma_m: float = 0.01, turn_rad: float = 0.0) -> WallSegment:
    start, end = ends
    return WallSegment(start, end, sigma_m, 100, turn_rad)


def test_a_length_is_as_certain_as_the_walls_at_both_ends() -> None:
    between = wall((0, 0), (0, 10), sigma_m=0.5)  # its own sigma is across, not along
    ends = wall((-5, 0.1), (5, 0.1), sigma_m=0.03), wall((0.2, 10), (8, 10), sigma_m=0.04)
    assert length_sigmas_m([between, *ends])[0] == pytest.approx(0.05, abs=0.001)


def test_a_free_end_is_as_uncertain_as_the_last_hits_of_a_wall() -> None:
    in_line = wall((0, 11), (0, 15))  # beyond a doorway
    sigmas_m = length_sigmas_m([wall((0, 0), (0, 10)), in_line])
    assert_allclose(sigmas_m, math.sqrt(2) * FREE_END_M)


def test_a_wall_that_may_be_turned_is_less_certain_far_from_its_middle() -> None:
    far = wall((0, 0), (10, 0), sigma_m=0.01, turn_rad=0.02)
    [sigma_m] = length_sigmas_m([wall((0, 0), (0, 5)), far])[:1]
    assert sigma_m > np.hypot(5 * 0.02, FREE_END_M) - 0.001


def test_no_walls_have_no_lengths() -> None:
    assert length_sigmas_m([]).shape == (0,)

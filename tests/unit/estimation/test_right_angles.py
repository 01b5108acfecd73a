"""Selection of walls to constrain to right angles."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.estimation.association.right_angles import square_pairs

FIRST_DEG = 0.1


def pairs(
    directions_deg: list[float], sigmas_deg: list[float], before_deg: list[float] | None = None
) -> tuple[tuple[int, int], ...]:
    angles_rad = [
        np.radians(angles_deg) for angles_deg in (before_deg or directions_deg, directions_deg)
    ]
    return square_pairs(angles_rad, np.diag(np.radians(sigmas_deg) ** 2))


@given(st.floats(-5.0, 5.0), st.sampled_from([0, 90, 180, 270]))
def test_a_wall_with_an_uncertain_direction_is_constrained_to_a_right_angle(
    off_deg: float, quarter_deg: float
) -> None:
    assert pairs([10.0, 10.0 + quarter_deg + off_deg], [FIRST_DEG, 2.0]) == ((1, 0),)


@given(st.floats(2.0, 43.0), st.sampled_from([-1, 1]), st.floats(0.11, 0.3))
def test_a_wall_that_is_known_to_be_oblique_is_not_constrained(
    off_deg: float, sign: int, sigma_deg: float
) -> None:
    assert pairs([10.0, 10.0 + sign * off_deg], [FIRST_DEG, sigma_deg]) == ()


def test_a_wall_is_constrained_to_the_wing_with_the_higher_likelihood() -> None:
    oblique = pairs([0.0, 4.5, 94.9], [FIRST_DEG, 0.2, 1.6])
    assert oblique == ((2, 1),)
    assert pairs([0.0, 4.5, 90.3], [FIRST_DEG, 0.2, 1.6]) == ((2, 0),)


@pytest.mark.parametrize("before_deg", [[0.0, 90.4], [180.0, 90.4]])
def test_a_wall_that_had_a_right_angle_before_the_step_keeps_it(before_deg: list[float]) -> None:
    now_deg = [before_deg[0], 94.0]
    assert pairs(now_deg, [FIRST_DEG, 0.4]) == ()
    assert pairs(now_deg, [FIRST_DEG, 0.4], before_deg) == ((1, 0),)


def test_fewer_than_two_walls_have_no_pairs() -> None:
    assert square_pairs((np.empty(0), np.empty(0)), np.empty((0, 0))) == ()
    assert pairs([math.pi], [FIRST_DEG]) == ()

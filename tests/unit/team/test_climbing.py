"""A drone of a team climbs above a teammate only where no lintel may be."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from companion.estimation.smoothing.state import Unknowns
from companion.team.on_board import CLIMB_BESIDE_M, is_in_line_with_wall

WALL_M = 3.0
"""Length of the wall at either side of the opening, m."""
bearings_rad = st.floats(-math.pi, math.pi)


def wall_with_opening(width_m: float, bearing_rad: float) -> Unknowns:
    """A wall 4 m from the origin, with an opening in its middle."""
    x = Unknowns.at(np.zeros((1, 3)), 0.0)
    lines = np.array([[bearing_rad, 4.0]] * 2)
    half_m = width_m / 2
    ends_m = np.array([[-WALL_M - half_m, -half_m], [half_m, WALL_M + half_m]])
    x.add_walls(lines, ends_m)
    return x


def place(x: Unknowns, before_m: float, along_m: float) -> tuple[float, float]:
    north_m, east_m = (x.normals[0] * (4.0 - before_m) + x.tangents[0] * along_m).tolist()
    return north_m, east_m


@given(st.floats(0.8, 2.2), bearings_rad, st.floats(-0.45, 0.45), st.floats(-1.0, 1.0))
def test_no_climb_in_or_beside_an_opening(
    width_m: float, bearing_rad: float, before_m: float, along: float
) -> None:
    """The up beam passes beside the lintel, and the hull does not."""
    x = wall_with_opening(width_m, bearing_rad)
    assert is_in_line_with_wall(x, place(x, before_m, along * (width_m / 2 + WALL_M)))


@given(bearings_rad, st.floats(0.6, 8.0), st.floats(-4.0, 4.0))
def test_a_climb_is_possible_away_from_walls(
    bearing_rad: float, before_m: float, along_m: float
) -> None:
    x = wall_with_opening(1.0, bearing_rad)
    assert before_m > CLIMB_BESIDE_M
    assert not is_in_line_with_wall(x, place(x, before_m, along_m))


def test_a_climb_is_possible_while_no_wall_is_known() -> None:
    assert not is_in_line_with_wall(Unknowns.at(np.zeros((1, 3)), 0.0), (0.0, 0.0))

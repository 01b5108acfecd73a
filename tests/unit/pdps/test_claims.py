"""Tests that of several drones exactly one looks at a place."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from companion.navigation.observation import Claim
from companion.pdps.claims import is_claimed, on_own_side, sooner_reached
from companion.pdps.viewpoints import Viewpoint
from tests.grids import open_ground, sweep_round, ways_from

PLACES = ((3.0, 0.0), (3.0, 0.5), (3.0, 1.0))


def look(north_m: float = 0.0) -> Viewpoint:
    return Viewpoint((0.0, 0.0), tuple((north + north_m, east) for north, east in PLACES))


def claim(
    arrives_in_s: float, *, comes_first: bool, from_ne_m: tuple[float, float] = (0.0, 0.0)
) -> Claim:
    return Claim(PLACES, arrives_in_s, False, comes_first, from_ne_m)


@given(st.floats(0, 100), st.floats(0, 100))
def test_exactly_one_of_two_drones_leaves_a_place_to_the_other(
    first_s: float, second_s: float
) -> None:
    first_leaves = is_claimed(look(), first_s, (claim(second_s, comes_first=False),))
    second_leaves = is_claimed(look(), second_s, (claim(first_s, comes_first=True),))
    assert first_leaves != second_leaves


def test_the_sooner_drone_goes() -> None:
    assert is_claimed(look(), 20.0, (claim(5.0, comes_first=False),))
    assert not is_claimed(look(), 5.0, (claim(20.0, comes_first=True),))


@given(st.floats(0, 100))
def test_another_place_is_not_claimed(arrives_in_s: float) -> None:
    assert not is_claimed(look(5.0), arrives_in_s, (claim(0.0, comes_first=True),))


def test_a_place_near_the_claimed_one_is_the_same() -> None:
    """The maps of two drones differ by the error of their alignment."""
    assert is_claimed(look(0.5), 20.0, (claim(5.0, comes_first=False),))


def test_round_a_building_each_drone_goes_away_from_the_other() -> None:
    """The teammate stands 2 m east of this drone."""
    west, east = Viewpoint((0.0, -3.0), PLACES), Viewpoint((0.0, 3.0), PLACES)
    ways = ways_from(open_ground(), (0.0, 0.0))
    assert on_own_side((east, west), ways, ((0.0, 2.0),)) == (west,)
    assert on_own_side((east, west), ways, ()) == (east, west)


def test_a_drone_goes_to_the_other_side_if_nothing_is_left_on_its_own() -> None:
    east = Viewpoint((0.0, 3.0), PLACES)
    ways = ways_from(open_ground(), (0.0, 0.0))
    assert on_own_side((east,), ways, ((0.0, 2.0),)) == (east,)


def test_a_teammate_without_a_path_to_this_drone_is_on_no_side() -> None:
    grid = open_ground(2.0)
    sweep_round(grid, (0.0, 9.0), 2.0, hit=False)
    west, east = Viewpoint((0.0, -1.0), PLACES), Viewpoint((0.0, 1.0), PLACES)
    assert on_own_side((east, west), ways_from(grid, (0.0, 0.0)), ((0.0, 9.0),)) == (east, west)


def test_each_cell_is_flown_over_by_the_drone_that_reaches_it_sooner() -> None:
    """Both drones know the same space; the second stands 2 m east of the first."""
    grid, places = open_ground(), ((0.0, 0.0), (0.0, 2.0))
    of_each = [ways_from(grid, place) for place in places]
    left = np.isfinite(of_each[0].metres)
    first, second = (
        sooner_reached(left, ways, (claim(0.0, comes_first=True, from_ne_m=there),))
        for ways, there in zip(of_each, places[::-1], strict=True)
    )
    assert np.array_equal(first | second, left)
    assert (first & second).sum() < 0.1 * first.sum()
    cell = of_each[0].ground.grid.cell
    assert first[cell((0.0, -2.0))]
    assert second[cell((0.0, 3.0))]

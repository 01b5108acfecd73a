"""Shortest paths through known space."""

from itertools import pairwise, product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.frames import segment_distance_m
from companion.mapping.rays import Ray
from companion.navigation.grid_planner import find_ground, find_ways, with_kept_out
from companion.safety.separation import KeepOut
from tests.grids import CLEAR_M, Place, length_m, open_ground, ways_from

ROOM = open_ground(reach_m=5.0)


def test_a_path_through_free_space_is_straight() -> None:
    ways = ways_from(open_ground(), (-2.0, 0.0))
    assert ways.to((2.0, 1.0)) == ((2.0, 1.0),)


def test_a_path_keeps_its_clearance_around_an_obstacle() -> None:
    grid = open_ground()
    grid.block((0.0, 0.0), 0.4)
    way = ways_from(grid, (-2.0, 0.0)).to((2.0, 0.0))
    assert length_m((-2.0, 0.0), way) > 4.1
    points = [(-2.0, 0.0), *way]
    for a, b in pairwise(points):
        for share in range(11):
            here = tuple(p + share / 10 * (q - p) for p, q in zip(a, b, strict=True))
            assert grid.nearest_m((here[0], here[1]), 2.0) > 0.35


def test_no_path_leads_through_unknown_space() -> None:
    assert not ways_from(open_ground(), (0.0, 0.0)).reaches((6.0, 0.0))


def test_a_path_leads_through_a_doorway_but_not_through_a_narrower_one() -> None:
    for width_m, passes in ((1.4, True), (0.9, True), (0.6, False)):
        grid = open_ground()
        for row in range(-40, 41):
            if abs(0.1 * row + 0.05) > width_m / 2:
                grid.block((0.1 * row + 0.05, 0.05), 0.01)
        assert ways_from(grid, (0.5, -2.0)).reaches((0.5, 2.0)) is passes


@pytest.mark.parametrize(("width_m", "least_m", "most_m"), [(0.9, 0.5, 1.2), (1.3, 5.0, 6.0)])
def test_repeated_plans_do_not_lead_far_into_a_passage_narrower_than_the_clearance(
    width_m: float, least_m: float, most_m: float
) -> None:
    grid = open_ground(reach_m=7.0)
    for row, column in product(range(-70, 71), range(0, 71)):
        if abs(0.1 * row + 0.05) > width_m / 2 and (column == 0 or abs(row) < 9):
            grid.block((0.1 * row + 0.05, 0.1 * column + 0.05), 0.01)
    here = (0.05, -1.0)
    while ways_from(grid, here).reaches(further := (here[0], here[1] + 0.1)) and further[1] < 6:
        here = further
    assert least_m < here[1] < most_m


@pytest.mark.parametrize(
    ("width_m", "came_through", "passes"),
    [(0.8, True, True), (0.8, False, False), (0.0, True, False)],
)
def test_a_passage_already_flown_is_free_unless_it_was_closed(
    width_m: float, came_through: bool, passes: bool
) -> None:
    grid = open_ground()
    for decimetre in range(-10, 11) if came_through else ():
        grid.add(Ray((0.05, 0.1 * decimetre), 0.0, 0.5, 0.01, is_hit=False, time_s=0.0))
    for row in range(-40, 41):
        if abs(0.1 * row + 0.05) > width_m / 2:
            grid.block((0.1 * row + 0.05, 0.05), 0.01)
    assert ways_from(grid, (0.5, -2.0)).reaches((0.5, 2.0)) is passes


@given(
    aside_m=st.floats(-1.0, 1.0),
    ahead_m=st.floats(-0.5, 0.5),
    radius_m=st.floats(0.9, 1.4),
)
def test_a_path_leads_round_a_teammate_with_the_right_of_way(
    aside_m: float, ahead_m: float, radius_m: float
) -> None:
    teammate = KeepOut((ahead_m, aside_m), radius_m)
    start, goal = (-3.0, 0.0), (3.0, 0.0)
    ways = find_ways(with_kept_out(find_ground(ROOM, start, CLEAR_M), [teammate]))
    way = ways.to(goal)
    near_m = min(segment_distance_m(teammate.ne_m, *leg) for leg in pairwise((start, *way)))
    assert near_m > radius_m - 0.15
    assert length_m(start, way) < 8.5


@pytest.mark.parametrize("teammate", [(0.05, 0.05), (0.5, -2.0)])
def test_a_teammate_in_the_only_doorway_or_beside_the_drone_forbids_no_path(
    teammate: Place,
) -> None:
    grid = open_ground()
    for row in range(-40, 41):
        if abs(0.1 * row + 0.05) > 0.7:
            grid.block((0.1 * row + 0.05, 0.05), 0.01)
    ground = with_kept_out(find_ground(grid, (0.5, -2.0), CLEAR_M), [KeepOut(teammate, 1.2)])
    assert find_ways(ground).reaches((0.5, 2.0))

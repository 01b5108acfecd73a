"""Paths through doorways, and along corridors as narrow as doorways."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from companion.mapping.occupancy import CELL_M, Occupancy
from companion.navigation.doorways import find_doorways, on_the_way, passed_squarely
from companion.navigation.grid_planner import CostGrid
from companion.navigation.path_follower import Way
from tests.grids import open_ground, ways_from, with_doorway

GOAL = (3.0, 0.0)


def corridor(insets: list[tuple[int, int]]) -> Occupancy:
    """A corridor to the north, 1.6 m wide.

    From 0.3 m on, its walls stand in by a number of cells on the left and right.
    """
    grid = open_ground()
    wide = [(0, 0)]
    begins = 40 + round(0.3 / CELL_M)
    rows = begins * wide + insets + (81 - begins - len(insets)) * wide
    for row, (left, right) in enumerate(rows):
        north_m = (row - 40 + 0.5) * CELL_M
        grid.block((north_m, left * CELL_M - 0.85), 0.01)
        grid.block((north_m, 0.85 - right * CELL_M), 0.01)
    return grid


def ways_to_the_goal(grid: Occupancy) -> tuple[CostGrid, Way, Way]:
    """The path to the goal as planned, and through the doorways on it; both with the start."""
    here = (0.0, 0.0)
    ways = ways_from(grid, here)
    way = ways.to(GOAL)
    doorways = on_the_way((), find_doorways(ways.ground, here, way), here, way)
    squared = passed_squarely(ways.ground, here, way, doorways)
    return ways.ground, (here, *way), (here, *squared)


def test_a_path_leads_straight_through_the_middle_of_a_doorway() -> None:
    _, _, way = ways_to_the_goal(with_doorway(1.5))
    before, after = way[1:3]
    assert before[0] < 1.5 < after[0]
    assert abs(before[1]) < CELL_M
    assert abs(after[1]) < CELL_M


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=22, max_size=22))
def test_the_path_along_a_narrow_corridor_never_leads_back(insets: list[tuple[int, int]]) -> None:
    """Doorways are found between insets, also where one is nearer than a straight approach."""
    ground, planned, squared = ways_to_the_goal(corridor(insets))
    assert squared[-1] == GOAL
    for (from_m, _), (to_m, _) in pairwise(squared):
        assert to_m >= from_m - CELL_M
    for leg in set(pairwise(squared)) - set(pairwise(planned)):
        assert ground.fits_along(*leg)

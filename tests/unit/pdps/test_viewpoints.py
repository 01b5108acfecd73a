"""Choice of the next viewpoint."""

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.config.settings import MissionConfig
from companion.mapping.occupancy import Occupancy
from companion.pdps.frontiers import TRIES, known_cells
from companion.pdps.tour import first_of_tour
from companion.pdps.viewpoints import OPEN_LOOKS, Viewpoint, looks
from companion.pdps.visibility import sights
from tests.grids import (
    OUTSIDE,
    PLAN,
    observation,
    open_ground,
    sweep_round,
    ways_from,
)


def test_a_frontier_is_visible_from_the_front_and_not_from_the_side() -> None:
    grid = open_ground()
    frontier = grid.cell((0.0, 2.0))
    known = known_cells(grid)
    known[:, frontier[1] + 1 :] = False
    before, beside = grid.cell((0.0, 0.5)), grid.cell((1.5, 2.0))
    [shown] = sights(grid, known, np.array([before, beside]), np.array([frontier]))
    assert shown.tolist() == [0, 0]


def test_a_viewpoint_has_unknown_space_behind_its_frontier() -> None:
    """From the side, the line through the frontier continues in known space."""
    grid = open_ground()
    known = known_cells(grid)
    for look in looks(ways_from(grid, (0.0, 0.0)), observation(), PLAN):
        from_north_m, from_east_m = look.from_ne_m
        for north_m, east_m in look.at_ne_m:
            away_m = math.hypot(north_m - from_north_m, east_m - from_east_m)
            beyond = np.arange(0.1, 0.55, 0.1) / away_m
            cells = [
                grid.cell(
                    (north_m + b * (north_m - from_north_m), east_m + b * (east_m - from_east_m))
                )
                for b in beyond.tolist()
            ]
            assert not all(grid.has(cell) and known[cell] for cell in cells)


def test_exterior_viewpoints_are_only_near_obstacles() -> None:
    grid = open_ground()
    ways = ways_from(grid, (0.0, 0.0))
    assert not looks(ways, observation(), OUTSIDE)
    assert looks(ways, observation(), PLAN)
    grid.block((3.0, 0.0), 0.3)
    for plan in (OUTSIDE, PLAN):
        found = looks(ways_from(grid, (0.0, 0.0)), observation(), plan)
        assert all(place[0] > 0 for look in found for place in look.at_ne_m)


@pytest.mark.parametrize("plan", [PLAN, OUTSIDE], ids=["in", "outside"])
def test_unknown_space_amid_known_space_gets_viewpoints(plan: MissionConfig) -> None:
    grid = Occupancy()
    for degree in range(0, 360, 40):
        bearing_rad = math.radians(degree)
        sweep_round(grid, (7 * math.cos(bearing_rad), 7 * math.sin(bearing_rad)), 3.0, hit=False)
    found = looks(ways_from(grid, (7.0, 0.0)), observation((7.0, 0.0)), plan)
    assert found
    assert all(math.hypot(*place) < 5 for look in found for place in look.at_ne_m)


def test_in_a_building_open_space_is_viewed_last_and_not_entered_far() -> None:
    here, pillar = (1.0, 0.0), tuple((0.1 * i, 0.1 * j) for i in range(-4, 5) for j in range(-4, 5))
    for reach_m, plan, has_more in ((4.0, OUTSIDE, False), (4.0, PLAN, True), (8.0, PLAN, False)):
        grid = open_ground(reach_m)
        grid.block((0.0, 0.0), 0.3)
        seen_enough = (Viewpoint((1.5, 0.0), pillar),) * TRIES
        assert bool(looks(ways_from(grid, here), observation(here), plan, seen_enough)) == has_more


@pytest.mark.parametrize(("strip_m", "is_open"), [(10, False), (34, True)])
def test_open_space_is_viewed_when_all_other_targets_are_far(strip_m: int, is_open: bool) -> None:
    """A hall wider than two ranges is open, too; only the outside has no end."""
    here, grid = (1.0, 0.0), open_ground(4.0)
    pillar = tuple((0.1 * i, 0.1 * j) for i in range(-4, 5) for j in range(-4, 5))
    grid.block((0.0, 0.0), 0.3)
    for north_m in range(4, strip_m, 2):
        sweep_round(grid, (float(north_m), 0.0), 2.0, hit=False)
    grid.block((strip_m + 1.0, 0.0), 0.3)
    seen_enough = (Viewpoint((1.5, 0.0), pillar),) * TRIES
    found = looks(ways_from(grid, here), observation(here), PLAN, seen_enough)
    assert found[0].is_open == is_open


def test_open_space_is_dropped_after_the_maximum_number_of_looks() -> None:
    ways, inside = ways_from(open_ground(), (0.0, 0.0)), Viewpoint((0.0, 0.0), ((9.0, 9.0),))
    into_the_open = replace(inside, is_open=True)
    assert looks(ways, observation(), PLAN, (into_the_open,) * (OPEN_LOOKS - 1))
    assert looks(ways, observation(), PLAN, (*(into_the_open,) * OPEN_LOOKS, inside))
    assert not looks(ways, observation(), PLAN, (into_the_open,) * OPEN_LOOKS)


def test_a_viewpoint_on_the_path_home_is_visited_on_the_return() -> None:
    ways = ways_from(open_ground(), (0.0, 0.0))
    near, far, home = (0.0, -1.0), (0.0, 3.0), (0.0, -3.0)
    assert first_of_tour(ways, (near, far), home) == 1
    assert first_of_tour(ways, (near, far), (0.0, 4.0)) == 0

"""Frontiers, and surfaces with only vague detections."""

import math

import numpy as np

from companion.mapping.occupancy import Occupancy
from companion.mapping.rays import Ray
from companion.pdps.frontiers import TRIES, frontiers, vague_surfaces
from companion.pdps.viewpoints import MIN_SHOWN, Viewpoint, looks
from tests.grids import (
    PLAN,
    observation,
    open_ground,
    sweep_round,
    walled,
    ways_from,
)


def test_a_closed_room_with_well_measured_walls_has_no_viewpoints() -> None:
    grid = walled(reach_m=2.0)
    assert not looks(ways_from(grid, (0.0, 0.0)), observation(), PLAN)


def test_a_doorway_is_a_frontier_with_a_viewpoint() -> None:
    grid = walled()
    for degree in range(-20, 21):
        for _ in range(20):
            grid.add(Ray((0.0, 0.0), math.radians(degree), 4.0, 0.01, False, 0.0))
    assert frontiers(grid).any()
    look, *_ = looks(ways_from(grid, (0.0, 0.0)), observation(), PLAN)
    for place in look.at_ne_m:
        assert abs(math.atan2(place[1], place[0])) < math.radians(25)


def test_walls_detected_only_from_far_away_get_a_nearer_viewpoint() -> None:
    grid = Occupancy()
    for degree in range(360):
        for _ in range(3):
            grid.add(Ray((0.0, 0.0), math.radians(degree), 3.5, 0.08, True, 0.0))
            grid.add(Ray((0.0, 0.0), math.radians(degree), 3.4, 0.0, False, 0.0))
    assert vague_surfaces(grid).any()
    look, *_ = looks(ways_from(grid, (0.0, 0.0)), observation(), PLAN)
    assert math.dist(look.from_ne_m, look.at_ne_m[0]) < 2.5


def test_a_wall_measured_well_from_one_side_gets_a_viewpoint_on_the_other() -> None:
    """The wall is 0.2 m thick: from one side only half of it is mapped."""
    grid = open_ground(1.5, (-2.0, 0.0))
    sweep_round(grid, (2.0, 0.0), 1.5, hit=False)
    near_side_m, far_side_m = -0.1, 0.1
    for centimetre in range(-100, 101, 5):
        east_m = 0.01 * centimetre
        for _ in range(8):
            grid.add(Ray((-2.0, east_m), 0.0, near_side_m + 2.0, 0.02, True, 0.0))
            grid.add(Ray((2.5, east_m), math.pi, 2.5 - far_side_m, 0.08, True, 0.0))
            grid.add(Ray((2.5, east_m), math.pi, 2.4 - far_side_m, 0.0, False, 0.0))
    rows = np.argwhere(vague_surfaces(grid))[:, 0]
    norths_m = [grid.place((row, 0))[0] for row in rows.tolist()]
    assert norths_m
    assert min(norths_m) > far_side_m
    edge = np.argwhere(frontiers(grid)).tolist()
    tried = Viewpoint((0.0, 0.0), tuple(grid.place((row, column)) for row, column in edge))
    ways = ways_from(grid, (2.0, 0.0))
    look, *_ = looks(ways, observation((2.0, 0.0)), PLAN, (tried,) * TRIES)
    assert look.from_ne_m[0] > far_side_m + 0.5


def test_small_frontiers_are_viewed_after_large_ones() -> None:
    grid = walled(reach_m=2.5)
    for degree in (*range(-15, 16), 90):
        for _ in range(20):
            grid.add(Ray((0.0, 0.0), math.radians(degree), 3.5, 0.01, False, 0.0))
    ways = ways_from(grid, (0.0, 0.0))
    large = looks(ways, observation(), PLAN)
    assert large
    assert all(len(look.at_ne_m) >= MIN_SHOWN for look in large)
    small = looks(ways, observation(), PLAN, large * TRIES)
    assert small
    assert all(len(look.at_ne_m) < MIN_SHOWN for look in small)


def test_a_frontier_left_after_a_look_gets_a_viewpoint_elsewhere() -> None:
    ways = ways_from(open_ground(), (0.0, 0.0))
    first, *_ = looks(ways, observation(), PLAN)
    for look in looks(ways, observation(), PLAN, (first,)):
        is_it_again = [min(math.dist(a, b) for b in first.at_ne_m) < 0.2 for a in look.at_ne_m]
        assert math.dist(look.from_ne_m, first.from_ne_m) > 0.3 or not any(is_it_again)


def test_a_frontier_is_dropped_after_the_maximum_number_of_looks() -> None:
    grid = open_ground()
    everywhere = tuple(
        (3.95 * math.cos(math.radians(d)), 3.95 * math.sin(math.radians(d))) for d in range(360)
    )
    ways = ways_from(grid, (0.0, 0.0))
    tried = (Viewpoint((1.0, 0.0), everywhere),) * TRIES
    assert looks(ways, observation(), PLAN, tried[1:])
    assert not looks(ways, observation(), PLAN, tried)

"""The map recalls obstacles that the memory has lost; the memory completes the map."""

import math

import numpy as np
import pytest

from companion.core.frames import points_to_frd
from companion.core.messages import Pose, Setpoint
from companion.mapping.occupancy import Occupancy
from companion.mapping.rays import Ray
from companion.safety.mapped_obstacles import recalled_frd_m, unmapped_ne_m
from companion.safety.obstacle_memory import Surroundings
from companion.safety.obstacle_points import KEPT_S
from companion.safety.velocity_guard import guarded

NOTHING_LATELY = np.empty((0, 2))
LATER_S = KEPT_S + 20.0


def with_a_partition_end(at_north_m: float = 2.0) -> Occupancy:
    """Grid with one obstacle, detected at the start from a position that the drone has left."""
    grid = Occupancy()
    for _ in range(3):
        grid.add(Ray((at_north_m, -2.0), math.pi / 2, 2.0, 0.03, is_hit=True, time_s=1.0))
    return grid


def pose(time_s: float = LATER_S, north_m: float = 1.0, yaw_rad: float = 0.0) -> Pose:
    return Pose(time_s, north_m, 0.0, -1.0, yaw_rad)


def recalled(grid: Occupancy, at: Pose, lately: np.ndarray = NOTHING_LATELY) -> np.ndarray:
    return recalled_frd_m(grid, at, lately)


def test_the_map_recalls_an_obstacle_that_was_detected_long_ago() -> None:
    grid = with_a_partition_end()
    assert not len(recalled(grid, pose(time_s=KEPT_S)))
    [(forward_m, right_m)] = recalled(grid, pose())
    assert (forward_m, right_m) == pytest.approx((1.0, 0.0), abs=0.1)
    [(forward_m, right_m)] = recalled(grid, pose(yaw_rad=math.pi / 2))
    assert (forward_m, right_m) == pytest.approx((0.0, -1.0), abs=0.1)


def test_the_drone_keeps_passage_clearance_to_mapped_obstacles_without_a_retreat() -> None:
    grid, at = with_a_partition_end(), np.array([0.0, -0.02])
    nearest_m = math.inf
    for _ in range(400):
        points = recalled_frd_m(
            grid, Pose(LATER_S, float(at[0]), float(at[1]), -1.0, 0.0), NOTHING_LATELY
        )
        safe = guarded(Setpoint(forward_m_s=1.0), Surroundings(recalled_frd_m=points), 0.3)
        at += 0.02 * np.array([safe.forward_m_s, safe.right_m_s])
        nearest_m = min(nearest_m, math.dist(at, (2.0, 0.0)))
        if len(points):
            hovering = guarded(Setpoint(), Surroundings(recalled_frd_m=points), 0.3)
            assert hovering == Setpoint()
    assert nearest_m > 0.3


def test_a_recent_obstacle_point_nearby_replaces_the_mapped_obstacle() -> None:
    grid = with_a_partition_end()
    assert not len(recalled(grid, pose(), np.array([(1.25, 0.1)])))
    assert len(recalled(grid, pose(), np.array([(1.0, 1.0)])))


def test_a_later_beam_or_flight_through_the_cell_removes_the_mapped_obstacle() -> None:
    grid = with_a_partition_end()
    for _ in range(20):
        grid.add(Ray((2.0, -2.0), math.pi / 2, 4.0, 0.03, is_hit=True, time_s=50.0))
    assert not len(recalled(grid, pose()))
    grid = with_a_partition_end()
    grid.add(Ray((2.05, 0.0), 0.0, 2.0, 0.03, is_hit=True, time_s=50.0))
    assert not len(recalled(grid, pose()))


def test_cells_blocked_only_for_the_planner_are_not_recalled() -> None:
    grid = Occupancy()
    grid.block((2.0, 0.0), 0.2)
    assert not len(recalled(grid, pose()))


def with_a_pole(pole_ne_m: tuple[float, float], passing: int) -> Occupancy:
    """Grid of a pole that two readings met, then beams passed beside it through the same cell."""
    grid = Occupancy()
    for _ in range(2):
        grid.add(Ray((0.0, 0.0), 0.0, pole_ne_m[0], 0.03, is_hit=True, time_s=1.0))
    for _ in range(passing):
        grid.add(Ray((0.0, 0.0), 0.01, 4.0, 0.03, is_hit=False, time_s=2.0))
    return grid


@pytest.mark.parametrize("yaw_rad", [0.0, 2.0])
@pytest.mark.parametrize(("passing", "is_lost"), [(0, False), (12, True)])
def test_paths_avoid_a_pole_that_beams_have_erased_from_the_map(
    passing: int, is_lost: bool, yaw_rad: float
) -> None:
    """A drone bounced for half a minute between poles that only the velocity limiter knew."""
    pole_ne_m, at = (2.05, 0.01), Pose(10.0, 0.2, 0.3, -1.0, yaw_rad)
    grid = with_a_pole(pole_ne_m, passing)
    measured_frd_m = points_to_frd(np.array([pole_ne_m]) - at.ne_m, yaw_rad)
    lost = unmapped_ne_m(grid, at, measured_frd_m)
    assert len(lost) == is_lost
    assert grid.nearest_m(pole_ne_m, 1.0) == (1.0 if is_lost else 0.0)
    planned = grid.with_obstacles(lost)
    assert planned.nearest_m(pole_ne_m, 1.0) == 0.0
    assert not planned.free[planned.cell(pole_ne_m)]
    assert grid.nearest_m(pole_ne_m, 1.0) == (1.0 if is_lost else 0.0)


def test_obstacles_outside_the_grid_are_ignored() -> None:
    grid = Occupancy()
    assert not grid.with_obstacles(np.array([[500.0, 0.0], [0.0, -500.0]])).occupied.any()

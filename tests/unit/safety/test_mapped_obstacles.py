"""Obstacles from minutes ago limit the velocity at their positions in the map."""

import math

import numpy as np
import pytest

from companion.core.messages import Pose, Setpoint
from companion.mapping.occupancy import Occupancy, Ray
from companion.safety.mapped_obstacles import recalled_frd_m
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

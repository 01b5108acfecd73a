"""Occupancy grids for tests, observations in them, and one step of a travel."""

import math
from dataclasses import replace
from itertools import pairwise

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2
from companion.core.messages import Beam, Pose, RangeReading, RangeState, Setpoint
from companion.mapping.occupancy import Occupancy
from companion.mapping.rays import Ray, Rays
from companion.navigation import travel as travelling
from companion.navigation.grid_planner import ShortestPaths, find_ground, find_ways
from companion.navigation.observation import Observation
from companion.navigation.path_follower import (
    ARRIVED_M,
    Course,
)
from companion.navigation.travel_state import Travel, onward

PLAN, OUTSIDE = MissionConfig(kind="building"), MissionConfig(kind="exterior")
CLEAR_M = 0.5
NORTH = Course(0.0)
Place = tuple[float, float]


def ways_from(grid: Occupancy, place_ne_m: Vector2) -> ShortestPaths:
    return find_ways(find_ground(grid, place_ne_m, CLEAR_M))


def open_ground(reach_m: float = 4.0, centre: Place = (0.0, 0.0)) -> Occupancy:
    """A disc of free space without walls."""
    grid = Occupancy()
    sweep_round(grid, centre, reach_m, hit=False)
    return grid


def sweep_round(grid: Occupancy, centre: Place, reach_m: float, *, hit: bool) -> None:
    round_once = [Ray(centre, math.radians(n), reach_m, 0.01, hit, 0.0) for n in range(360)]
    grid.draw(Rays.of(3 * round_once))


def walled(centre: Place = (0.0, 0.0), reach_m: float = 3.0) -> Occupancy:
    """A round room without a door."""
    grid = Occupancy()
    sweep_round(grid, centre, reach_m, hit=True)
    return grid


def observation(
    place: Place = (0.0, 0.0), yaw_rad: float = 0.0, ahead_m: float = 5.0, time_s: float = 10.0
) -> Observation:
    ahead = RangeReading(RangeState.DISTANCE, ahead_m, 0.01)
    return Observation(Pose(time_s, *place, -PLAN.height_m, yaw_rad), {Beam.FRONT: ahead}, 0.0)


def length_m(start: Place, way: tuple[Place, ...]) -> float:
    return sum(math.dist(a, b) for a, b in pairwise((start, *way)))


def step_travel(
    travel: Travel, grid: Occupancy, *, ahead_m: float = 5.0, time_s: float = 10.0
) -> tuple[Travel, Setpoint]:
    return travelling.step(travel, observation(ahead_m=ahead_m, time_s=time_s), grid, PLAN)


def remaining_headings_rad(travel: Travel) -> tuple[float, ...]:
    """Remaining headings of the sweep."""
    assert travel.sweep is not None
    return travel.sweep.headings_rad


def with_doorway(ahead_m: float) -> Occupancy:
    grid = open_ground()
    for row in range(-40, 41):
        if abs(0.1 * row + 0.05) > 0.5:
            grid.block((ahead_m, 0.1 * row + 0.05), 0.01)
    return grid


def stuck_on_a_path(before: Travel | None) -> Travel:
    """Travel of a drone that has turned all round and is stuck at the start."""
    grid = open_ground()
    travel = replace(onward(before, (3.0, 0.0), ARRIVED_M), looked_round=True)
    for time_s in (10.0, 21.0):
        travel, _ = step_travel(travel, grid, time_s=time_s)
    return travel

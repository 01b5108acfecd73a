"""Keeps the drone below `mission.max_height_m` and within `mission.max_distance_m` of its start.

    planner          no path ends nearer than `INSIDE_M` to the limit
    velocity guard   the drone can always stop `BEFORE_M` before it; beyond, it comes back
    climb            no height is commanded within `BELOW_TOP_M` of the top

The autopilot's own fence lies `OUTSIDE_M` farther, and lands.
"""

import math

from companion.config.settings import BELOW_TOP_M, MissionConfig
from companion.core.frames import Vector2, ned_to_frd
from companion.core.messages import Pose
from companion.core.values import value
from companion.mapping.occupancy import CELL_M, Occupancy

BEFORE_M = 0.15
"""Distance before the limit at which the velocity guard stops the drone, m. Chosen: along a curved
edge, the guard is late by up to 0.06 m at 2 m/s (`tests/unit/safety/test_fence.py`)."""
INSIDE_M = 0.4
"""Distance before the limit that no path enters, m. Chosen: no path ends in the guard's brakes."""


@value
class Edge:
    """The nearest place of the fence."""

    towards_frd: Vector2
    """Unit vector from the drone to it, body FRD."""
    away_m: float
    """Distance to it, m; negative outside."""


def top_m(plan: MissionConfig) -> float:
    """Greatest height that is commanded, m; infinite without a limit."""
    return math.inf if plan.max_height_m is None else plan.max_height_m - BELOW_TOP_M


def reach_m(plan: MissionConfig) -> float:
    """Greatest distance from the start to which a path leads, m; infinite without a limit."""
    return math.inf if plan.max_distance_m is None else plan.max_distance_m - INSIDE_M


def edge(pose: Pose, plan: MissionConfig) -> Edge | None:
    """The edge in the direction away from the start; None without a limit."""
    if plan.max_distance_m is None:
        return None
    distance_m = math.hypot(*pose.ne_m)
    outward = (pose.north_m, pose.east_m) if distance_m > CELL_M else (1.0, 0.0)
    forward, right = ned_to_frd(*outward, pose.yaw_rad)
    length = math.hypot(forward, right)
    away_m = plan.max_distance_m - BEFORE_M - distance_m
    return Edge((forward / length, right / length), away_m)


def inside(space: Occupancy, here_ne_m: Vector2, plan: MissionConfig, clear_m: float) -> Occupancy:
    """The map for the planner, in which no path leads near the edge.

    From a place nearer to it the way back stays open. `clear_m` is the clearance to what is
    forbidden, m.
    """
    if plan.max_distance_m is None:
        return space
    centre_m = max(reach_m(plan), math.hypot(*here_ne_m) + CELL_M)
    return space.within(centre_m + clear_m)

"""Merges walls that are one surface."""

import math

import numpy as np

from companion.core.arrays import Array, Indices
from companion.core.frames import wrap_rad
from companion.estimation.association.gating import UNEXPLAINED
from companion.estimation.association.steps import Steps
from companion.estimation.association.straightness import bend
from companion.estimation.smoothing.state import WALL_SIZE, Rays, Unknowns

SAME_DIRECTION_RAD = math.radians(15)
"""Walls whose directions differ by more are not merged, rad. Chosen."""
MAX_MERGE_GAP_M = 1.5
"""Maximum gap between walls that are merged, m. Chosen: wider than a double door."""
MAX_MEAN_COST = 1.8
"""Largest mean χ² of each wall's hits about the common line. Chosen."""


def merge(
    x: Unknowns,
    rays: Rays,
    sigma_m: Array,
    wall_of: Indices,
    steps: Steps,
    *,
    known: int,
) -> bool:
    """Merge walls of one surface and drop walls without hits; True if the number of walls changed.

    Two walls are merged if they overlap or nearly do, and a common line fits the hits of each
    within their noise. Rooms in a row often have walls that are nearly in line. A known wall keeps
    its line; a new wall of the same surface is dropped. Two walls with a step between them are not
    merged.
    """
    support = np.bincount(wall_of[wall_of >= 0], minlength=len(x.walls))
    order = [*range(known), *(known + np.argsort(-support[known:], kind="stable"))]
    lines: list[Array] = []
    members: list[Indices] = []
    reaches: list[Array] = []
    for wall in order:
        own_hits = np.flatnonzero(wall_of == wall)
        own, own_reach = x.walls[wall], x.reach_m[wall]
        if wall < known:
            lines.append(own)
            members.append(own_hits)
            reaches.append(own_reach)
            continue
        if not len(own_hits):
            continue
        for i, line in enumerate(lines):
            if abs(wrap_rad(float(line[0] - own[0]))) > SAME_DIRECTION_RAD:
                continue
            if max(own_reach[0] - reaches[i][1], reaches[i][0] - own_reach[1]) > MAX_MERGE_GAP_M:
                continue
            both = np.concatenate([members[i], own_hits])
            common = line if i < known else fitted(line, rays.points[both], sigma_m[both])
            sets = [own_hits] if i < known else [members[i], own_hits]
            costs = [_mean_cost(common, rays.points[hits], sigma_m[hits]) for hits in sets]
            is_one = max(costs) < MAX_MEAN_COST
            is_one = is_one and _is_straight(common, rays.points[both], sigma_m[both])
            if is_one and not steps.separates(members[i], own_hits, float(common[0])):
                lines[i], members[i] = common, both
                wider = (
                    min(reaches[i][0], own_reach[0]),
                    max(reaches[i][1], own_reach[1]),
                )
                reaches[i] = np.array(wider)
                break
        else:
            lines.append(own)
            members.append(own_hits)
            reaches.append(own_reach)
    if len(lines) == len(x.walls):
        return False
    x.walls = np.array(lines).reshape(-1, WALL_SIZE)
    x.reach_m = np.array(reaches).reshape(-1, 2)
    return True


def fitted(line: Array, points: Array, sigma_m: Array) -> Array:
    """The line refitted to the points; it must be nearly aligned already."""
    normal = np.array([math.cos(line[0]), math.sin(line[0])])
    along = points @ (-normal[1], normal[0])
    slope, across_m = np.polyfit(along, points @ normal, 1, w=1 / sigma_m)
    turned_rad = math.atan(slope)
    return np.array([line[0] - turned_rad, across_m * math.cos(turned_rad)])


def _is_straight(line: Array, points: Array, sigma_m: Array) -> bool:
    along_m = points @ (-math.sin(line[0]), math.cos(line[0]))
    across_m = points @ (math.cos(line[0]), math.sin(line[0])) - line[1]
    return bend(along_m, across_m, sigma_m).is_straight


def _mean_cost(line: Array, points: Array, sigma_m: Array) -> float:
    """Mean χ² of points about a line, each limited to `UNEXPLAINED`."""
    if not len(points):
        return 0.0
    across_m = points @ (math.cos(line[0]), math.sin(line[0])) - line[1]
    return float(np.minimum((across_m / sigma_m) ** 2, UNEXPLAINED).mean())

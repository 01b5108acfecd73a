"""Walls that are one, made one."""

import math

import numpy as np

from companion.core.frames import wrap_rad
from companion.estimation.association.gating import UNEXPLAINED
from companion.estimation.association.steps import Steps
from companion.estimation.association.straightness import bend
from companion.estimation.smoothing.state import WALL_SIZE, Array, Indices, Sightings, Unknowns

SAME_DIRECTION_RAD = math.radians(15)
LARGEST_GAP_M = 1.5
"""Walls farther apart than this are two, however well they are in line."""
MAX_MEAN_COST = 1.8


def merge(
    x: Unknowns,
    seen: Sightings,
    sigma_m: Array,
    wall_of: Indices,
    steps: Steps,
    *,
    known: int,
) -> bool:
    """Make one of walls that are one; keep none without hits. Whether that changed any.

    Two are one if they go on where the other ends, or nearly, and a common line fits the hits of
    each as well as their noise allows: rooms in a row often have walls that are nearly in line. A
    known wall stays where it is; a new one that is the same goes. Two with a step between them are
    not one, however well a line fits both.
    """
    support = np.bincount(wall_of[wall_of >= 0], minlength=len(x.walls))
    order = [*range(known), *(known + np.argsort(-support[known:], kind="stable"))]
    lines: list[Array] = []
    members: list[Indices] = []
    reaches: list[Array] = []
    for wall in order:
        mine = np.flatnonzero(wall_of == wall)
        own, own_reach = x.walls[wall], x.reach_m[wall]
        if wall < known:
            lines.append(own)
            members.append(mine)
            reaches.append(own_reach)
            continue
        if not len(mine):
            continue
        for i, line in enumerate(lines):
            if abs(wrap_rad(float(line[0] - own[0]))) > SAME_DIRECTION_RAD:
                continue
            if max(own_reach[0] - reaches[i][1], reaches[i][0] - own_reach[1]) > LARGEST_GAP_M:
                continue
            both = np.concatenate([members[i], mine])
            common = line if i < known else fitted(line, seen.points[both], sigma_m[both])
            sets = [mine] if i < known else [members[i], mine]
            costs = [_mean_cost(common, seen.points[hits], sigma_m[hits]) for hits in sets]
            is_one = max(costs) < MAX_MEAN_COST
            is_one = is_one and _is_straight(common, seen.points[both], sigma_m[both])
            if is_one and not steps.part(members[i], mine, float(common[0])):
                lines[i], members[i] = common, both
                wider = (
                    min(reaches[i][0], own_reach[0]),
                    max(reaches[i][1], own_reach[1]),
                )
                reaches[i] = np.array(wider)
                break
        else:
            lines.append(own)
            members.append(mine)
            reaches.append(own_reach)
    if len(lines) == len(x.walls):
        return False
    x.walls = np.array(lines).reshape(-1, WALL_SIZE)
    x.reach_m = np.array(reaches).reshape(-1, 2)
    return True


def fitted(line: Array, points: Array, sigma_m: Array) -> Array:
    """The line moved and turned to fit the points best; it is nearly there already."""
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
    """χ² of points about a line by their number, each at most that of an unexplained one."""
    if not len(points):
        return 0.0
    across_m = points @ (math.cos(line[0]), math.sin(line[0])) - line[1]
    return float(np.minimum((across_m / sigma_m) ** 2, UNEXPLAINED).mean())

"""Divides the viewpoints between the drones of a team: who sees it first, goes.

A drone tells its teammates what it goes to look at, and when it will be there. A viewpoint whose
targets a teammate sees sooner is left to it. Of two drones that are equally soon, the first by
number goes. Both decide by the same rule, so no leader is needed.

Round a building, a drone first goes to the viewpoints that are nearer to it than to a teammate. So
two drones go round opposite ways, until they meet at its far side.
"""

from dataclasses import replace

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import Vector2, to_nearest_m
from companion.navigation.grid_planner import ShortestPaths, find_ways
from companion.navigation.observation import Claim
from companion.pdps.viewpoints import Viewpoint

SAME_M = 1.0
"""A target is the same as a teammate's within this distance, m. Chosen: the error of the alignment,
and of the targets on two maps."""
SAME_SHARE = 0.5
"""A viewpoint with more than this share of its targets claimed is claimed. Chosen."""
EQUALLY_SOON_S = 2.0
"""Two drones are equally soon within this time, s. Chosen."""


def is_claimed(look: Viewpoint, arrives_in_s: float, claims: tuple[Claim, ...]) -> bool:
    """True if a teammate sees the targets of a viewpoint sooner than this drone."""
    return any(_is_same(look, claim) and _is_sooner(claim, arrives_in_s) for claim in claims)


def nearer(
    looks: tuple[Viewpoint, ...], ways: ShortestPaths, others_ne_m: tuple[Vector2, ...]
) -> tuple[Viewpoint, ...]:
    """The viewpoints to which no teammate has a shorter path; all, if one has to each.

    `ways` are the paths of this drone, to all viewpoints.
    """
    grid = ways.ground.grid
    theirs = [_metres_from(place, ways) for place in others_ne_m]
    cells = [grid.cell(look.from_ne_m) for look in looks]
    own = tuple(
        look
        for look, cell in zip(looks, cells, strict=True)
        if all(ways.metres[cell] <= metres[cell] for metres in theirs)
    )
    return own or looks


def _metres_from(place_ne_m: Vector2, ways: ShortestPaths) -> Array:
    """Cost of the path to each cell from the passable cell that is nearest to a place."""
    passable = np.argwhere(ways.ground.passable)
    off = np.abs(passable - np.array(ways.ground.grid.cell(place_ne_m)))
    row, column = passable[int(off.sum(axis=1).argmin())].tolist()
    return find_ways(replace(ways.ground, start=(row, column))).metres


def _is_same(look: Viewpoint, claim: Claim) -> bool:
    apart_m = to_nearest_m(np.array(look.at_ne_m), np.array(claim.places_ne_m))
    return float((apart_m < SAME_M).mean()) > SAME_SHARE


def _is_sooner(claim: Claim, arrives_in_s: float) -> bool:
    ahead_s = arrives_in_s - claim.arrives_in_s
    return ahead_s > EQUALLY_SOON_S or (claim.comes_first and ahead_s >= -EQUALLY_SOON_S)

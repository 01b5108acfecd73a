"""Prunes associations and walls that lack support."""

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from companion.core.arrays import Array, Indices
from companion.core.frames import wrap_rad
from companion.estimation.association.gating import (
    MIN_COS_INCIDENCE,
    UNEXPLAINED,
    Candidates,
)
from companion.estimation.association.merging import MAX_MERGE_GAP_M, SAME_DIRECTION_RAD, fitted
from companion.estimation.association.straightness import bend, longer_side
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.state import Measured, Rays, Unknowns, in_rows, reach_m

MAX_WALLS = 400
"""Most walls kept. More occur only if odometry drifts without bound. Chosen."""
STRETCH_M = 0.5
"""Length of the stretches in which near walls compete for hits, m. Chosen."""
MAX_CUTS = 8
"""Most cuts of one wall at its bends. Chosen."""
OCCLUDER_M, MIN_OCCLUDING, MAX_THROUGH_SHARE = 0.15, 3, 0.1
"""An occluder is at least this far before a wall, m; at least this many beams end on it; and at
most this share of as many beams passes. Chosen."""
NEIGHBOUR_KEYFRAMES, MIN_NEIGHBOURS = 5, 4
"""Keyframes to either side (one second), and least hits on a wall among them. A turning beam passes
a metre of wall in this many hits. Chosen."""


@dataclass(frozen=True, slots=True)
class Support:
    """Minimum support of a wall."""

    hits: int = 12
    extent_m: float = 0.35
    """Extent of the hits along the wall, m."""
    worth: float = 60.0
    worth_per_hit: float = 2.0
    """χ² that the wall saves over all hits, in total and per hit. Two lines through the noise of
    one wall save about 1 per hit."""
    normal_sigma_rad: float = math.radians(4)
    """Largest sigma of the direction, rad. Without this limit a wall could have any direction."""
    gap_m: float = 1.2
    """Hits with a larger gap along a line do not support a new wall together, m."""
    opening_m: float = 0.4
    """A larger gap between hits along a wall may be an opening, m."""

    def needed(self, hits: Array | Indices) -> Array:
        """Least χ² saved by walls or pieces with this many hits each."""
        needed: Array = np.maximum(self.worth, self.worth_per_hit * hits)
        return needed


def one_wall_per_stretch(x: Unknowns, rays: Rays, pairs: Candidates) -> Candidates:
    """Assign each stretch that two walls compete for to the wall with more hits there.

    One of the two would hide the other. A line that nearly coincides with a wall takes a share of
    its hits where both are near, and could exist by those alone.
    """
    wall_of = pairs.best()
    may_be = np.zeros((pairs.hits, len(x.walls)), dtype=bool)
    may_be[pairs.hit, pairs.wall] = True
    for one, other in combinations(range(len(x.walls)), 2):
        if abs(wrap_rad(float(x.walls[one, 0] - x.walls[other, 0]))) > SAME_DIRECTION_RAD:
            continue
        either = np.flatnonzero(may_be[:, one] & may_be[:, other])
        if not len(either):
            continue
        stretch = np.floor(rays.points @ x.tangents[one] / STRETCH_M).astype(np.int64)
        stretch -= stretch.min()
        size = int(stretch.max()) + 1
        of_one = np.bincount(stretch[wall_of == one], minlength=size)
        of_other = np.bincount(stretch[wall_of == other], minlength=size)
        at = stretch[either]
        may_be[either[of_one[at] > of_other[at]], other] = False
        may_be[either[of_one[at] < of_other[at]], one] = False
    return pairs.only(may_be[pairs.hit, pairs.wall])


def without_distant_rows(
    x: Unknowns, rays: Rays, pairs: Candidates, support: Support
) -> Candidates:
    """Remove hits far from the row of hits that supports a wall most.

    Another row must have sufficient support of its own, and something must occlude the wall between
    both rows, such as a cupboard. Otherwise it is another wall. A line through two short pieces
    always exists, and near the end of a wall another often begins. With a lever of metres such a
    line would turn the whole trajectory.
    """
    hit, wall, worth = pairs.worths()
    order, along, is_first = in_rows(x, rays.points[hit], wall, MAX_MERGE_GAP_M)
    hit, wall, worth = hit[order], wall[order], worth[order]
    row = np.cumsum(is_first) - 1
    first = np.flatnonzero(is_first)
    last = np.append(first, len(hit))[1:] - 1
    of_row, low_m, high_m = wall[first], along[first], along[last]
    worths = np.bincount(row, worth, len(first))
    hits = np.bincount(row, minlength=len(first))
    main = np.full(len(x.walls), -1)
    upwards = np.argsort(worths, kind="stable")
    main[of_row[upwards]] = upwards
    is_distant = worths < support.needed(hits)
    for number in np.flatnonzero(~is_distant & (main[of_row] != np.arange(len(first)))):
        on = main[of_row[number]]
        gap_m = sorted((low_m[number], high_m[number], low_m[on], high_m[on]))[1:3]
        is_distant[number] = not _is_occluded(x, rays, int(of_row[number]), *gap_m)
    is_distant[main[main >= 0]] = False
    removed_from = np.full(len(rays.points), NO_WALL)
    removed_from[hit[is_distant[row]]] = wall[is_distant[row]]
    return pairs.only(removed_from[pairs.hit] != pairs.wall)


def _is_occluded(x: Unknowns, rays: Rays, wall: int, low_m: float, high_m: float) -> bool:
    """True if an occluder hides a stretch of a wall's line: beams ended before it, not behind.

    False if no beam crossed the stretch.
    """
    cos = rays.beams @ x.normals[wall]
    before_m = x.walls[wall, 1] - rays.origins @ x.normals[wall]
    towards = (before_m > 0) & (cos > MIN_COS_INCIDENCE)
    ahead_m = before_m[towards] / cos[towards]
    origins, beams = rays.origins[towards], rays.beams[towards]
    met_m = (origins + ahead_m[:, None] * beams) @ x.tangents[wall]
    range_m = ((rays.points[towards] - origins) * beams).sum(axis=1)
    inside = (met_m > low_m) & (met_m < high_m)
    ended = int((inside & (range_m < ahead_m - OCCLUDER_M)).sum())
    passed = int((inside & (range_m > ahead_m + OCCLUDER_M)).sum())
    return ended >= MIN_OCCLUDING and passed <= MAX_THROUGH_SHARE * ended


def without_isolated_hits(m: Measured, pairs: Candidates) -> Candidates:
    """Remove hits that are nearly alone on their wall at their time.

    A wall in range returns many hits. A single hit on something else, as at a corner, would
    determine the position where nothing else does.
    """
    wall_of = pairs.best()
    hit = np.flatnonzero(wall_of != NO_WALL)
    key = wall_of[hit] * (int(m.frame.max(initial=0)) + 3 * NEIGHBOUR_KEYFRAMES) + m.frame[hit]
    in_order = np.sort(key)
    neighbours = np.searchsorted(in_order, key + NEIGHBOUR_KEYFRAMES, side="right")
    neighbours -= np.searchsorted(in_order, key - NEIGHBOUR_KEYFRAMES)
    is_isolated = np.zeros(len(wall_of), dtype=bool)
    is_isolated[hit[neighbours < MIN_NEIGHBOURS]] = True
    return pairs.only(~is_isolated[pairs.hit])


def without_bends(
    x: Unknowns, rays: Rays, sigma_m: Array, pairs: Candidates, known: int
) -> Candidates:
    """Cut walls where their hits bend. The hits cut off may form another wall."""
    wall_of = pairs.best()
    cut_off = np.full(len(wall_of), NO_WALL)
    for wall in range(known, len(x.walls)):
        on_wall: Indices = np.flatnonzero(wall_of == wall)
        for _ in range(MAX_CUTS):
            if len(on_wall) < 2:
                break
            along = rays.points[on_wall] @ x.tangents[wall]
            line = fitted(x.walls[wall], rays.points[on_wall], sigma_m[on_wall])
            across = rays.points[on_wall] @ (math.cos(line[0]), math.sin(line[0])) - line[1]
            bent = bend(along, across, sigma_m[on_wall])
            if bent.is_straight:
                break
            kept = longer_side(along, bent.at_m)
            cut_off[on_wall[~kept]] = wall
            on_wall = on_wall[kept]
    return pairs.only(cut_off[pairs.hit] != pairs.wall)


def without_weak_walls(
    x: Unknowns,
    rays: Rays,
    sigma_m: Array,
    pairs: Candidates,
    support: Support,
    *,
    passed: Indices,
    known: int,
) -> tuple[Candidates, Indices]:
    """Remove the walls with the least support one by one. Returns the pairs and walls that stay.

    `passed` (w,): number of beams that passed through each wall. Each of them contradicts the wall
    as much as a hit without a wall.
    """
    kept = np.arange(len(x.walls))
    while len(kept) > known:
        _, wall, worth = pairs.worths()
        hits = np.bincount(wall, minlength=len(x.walls)).astype(float)
        saved = np.bincount(wall, worth, len(x.walls)) - UNEXPLAINED * passed
        worths = saved / support.needed(hits)
        wall_of = pairs.best()
        low_m, high_m = reach_m(x, rays.points, wall_of).T
        is_uncertain = _normal_sigma_rad(x, rays, sigma_m, wall_of) > support.normal_sigma_rad
        worths[(hits < support.hits) | (high_m - low_m < support.extent_m) | is_uncertain] = 0.0
        candidate_walls = kept[kept >= known]
        least = candidate_walls[int(worths[candidate_walls].argmin())]
        if worths[least] >= 1 and len(kept) <= MAX_WALLS:
            break
        gone = (
            candidate_walls[worths[candidate_walls] <= 0]
            if worths[least] <= 0
            else np.array([least])
        )
        kept = np.setdiff1d(kept, gone)
        pairs = pairs.only(~np.isin(pairs.wall, gone))
    return pairs, kept


def _normal_sigma_rad(x: Unknowns, rays: Rays, sigma_m: Array, wall_of: Indices) -> Array:
    """(w,): sigma of each wall's direction by its hits, assuming that they are correct."""
    hit = np.flatnonzero(wall_of != NO_WALL)
    wall, weight = wall_of[hit], sigma_m[hit] ** -2.0
    along_m = (rays.points[hit] * x.tangents[wall]).sum(axis=1)
    count = len(x.walls)
    total = np.maximum(np.bincount(wall, weight, count), 1e-9)
    arm_m = along_m - (np.bincount(wall, weight * along_m, count) / total)[wall]
    spread = np.bincount(wall, weight * arm_m**2, count)
    sigma_rad: Array = 1 / np.sqrt(np.maximum(spread, 1e-9))
    return sigma_rad

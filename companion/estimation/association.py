"""Which hit belongs to which wall, and which walls there are.

Decided anew in every round of the smoother, with an ever narrower gate. A wall stays if it is
worth its two unknowns: if the hits would fit clearly worse without it. Walls that are one, and
rows of noise beside a real wall, are not; nor are pieces of wall through which beams went.
"""

import math
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from companion.estimation.evidence import refuted
from companion.estimation.flight_record import NO_WALL
from companion.estimation.range_units import RangeUnits
from companion.estimation.straightness import bend, longer_side
from companion.estimation.unknowns import (
    WALL_SIZE,
    Array,
    Indices,
    Measured,
    Sightings,
    Unknowns,
    project,
    reach_m,
)
from companion.frames import wrap_rad

Mask = NDArray[np.bool_]

GATE_SIGMAS = 3.0
LEAST_COS_INCIDENCE = math.cos(math.radians(70))
NEAR_END_SIGMAS = 2.0
SAME_DIRECTION_RAD = math.radians(15)
LARGEST_GAP_M = 1.5
"""A piece of a wall farther than this from the rest of it must have support of its own."""
UNEXPLAINED = GATE_SIGMAS**2
"""χ² of a hit that fits no wall."""
MOST_MEAN_COST = 1.8
MOST_WALLS = 400
"""Those worth most; more come only of odometry that drifts without end."""
STRETCH_M = 0.5
MOST_CUTS = 8
NEIGHBOURS = 3
"""So many hits of a beam before and after one have a say in which wall it is on."""
CELLS_AT_ONCE = 1_000_000
"""Hits times walls looked at together, which bounds the memory."""


@dataclass(frozen=True, slots=True)
class Gate:
    """How far from a wall a hit may be to be one of its hits."""

    across_m: float
    """Off its line, besides three sigmas of the range: what the poses may be off."""
    along_m: float = math.inf
    """Beyond its ends."""
    looks: int = 0
    """New walls are looked for among the hits of so many keyframes at a time; not at all if 0."""
    refutes: bool = False
    """The poses are exact enough to tell that beams went through a wall, or that it bends."""


@dataclass(frozen=True, slots=True)
class Support:
    """The least that speaks for a wall."""

    hits: int = 12
    extent_m: float = 0.6
    """From the first to the last of them along the wall."""
    worth: float = 60.0
    worth_a_hit: float = 2.0
    """By how much it lowers the χ² of all hits. Two lines through the noise of one wall lower it
    by about 1 for each hit."""
    gap_m: float = 1.2
    """Hits farther apart along a line than this do not show a new wall together."""
    opening_m: float = 0.4
    """There may be an opening where hits along a wall are farther apart than this."""

    def needed(self, hits: Array | Indices) -> Array:
        """The least worth of walls or pieces with so many hits each."""
        needed: Array = np.maximum(self.worth, self.worth_a_hit * hits)
        return needed


@dataclass(frozen=True, slots=True)
class Candidates:
    """Pairs of a hit and a wall that it may be on, by hits, the best wall first."""

    hits: int
    """How many there are, those without any wall included."""
    hit: Indices
    wall: Indices
    misfit: Array
    """In widened sigmas, below `GATE_SIGMAS`."""

    def only(self, kept: Mask) -> "Candidates":
        """Those of the pairs for which the mask (pairs,) holds."""
        return replace(self, hit=self.hit[kept], wall=self.wall[kept], misfit=self.misfit[kept])

    @property
    def is_best(self) -> Mask:
        """(pairs,): the first of each hit."""
        first: Mask = np.diff(self.hit, prepend=-1) > 0
        return first

    def best(self) -> Indices:
        """(n,): the wall that each hit fits best, or NO_WALL."""
        first = self.is_best
        wall_of = np.full(self.hits, NO_WALL)
        wall_of[self.hit[first]] = self.wall[first]
        return wall_of

    def worths(self) -> tuple[Indices, Indices, Array]:
        """Of hits that have a wall: the hit, its wall, and how much more it would cost without."""
        first = np.flatnonzero(self.is_best)
        second = np.append(self.misfit[1:], 0.0)[first] ** 2
        has_second = np.append(self.hit[1:], -1)[first] == self.hit[first]
        without = np.where(has_second, second, UNEXPLAINED)
        return self.hit[first], self.wall[first], without - self.misfit[first] ** 2


@dataclass(frozen=True, slots=True)
class Association:
    """Gives hits to walls, by what is known of the range units and what speaks for a wall."""

    units: RangeUnits
    support: Support

    def associate(self, x: Unknowns, m: Measured, gate: Gate, known: int = 0) -> Indices:
        """(n,): each hit's wall or NO_WALL, after walls without worth were taken out of `x`.

        The first `known` walls are there whatever these hits say. The reach of all is told anew.
        """
        seen = project(x, m)
        pairs = self.candidates(x, m, seen, gate)
        sigma_m = self.units.sigma_m(m.beam, m.distance_m)
        if _merge(x, seen, sigma_m + gate.across_m / GATE_SIGMAS, pairs.best(), known):
            pairs = self.candidates(x, m, seen, gate)
        pairs = _one_wall_a_stretch(x, seen, pairs)
        pairs = _without_strays(x, seen, pairs, self.support)
        if gate.refutes:
            pairs = _without_bends(x, seen, sigma_m, pairs, known)
            wall_of = pairs.best()
            wrong = refuted(x, seen, sigma_m, wall_of, self.support.opening_m)
            pairs = pairs.only(~(wrong[pairs.hit] & (wall_of[pairs.hit] == pairs.wall)))
        pairs, kept = _worthy(x, seen, pairs, self.support, known)
        number = np.full(len(x.walls) + 1, NO_WALL)
        number[kept] = np.arange(len(kept))
        wall_of = number[pairs.best()]
        past = x.reach_m[:known]
        x.keep_walls(kept)
        x.reach_m = reach_m(x, seen.points, wall_of)
        x.reach_m[:known, 0] = np.minimum(x.reach_m[:known, 0], past[:, 0])
        x.reach_m[:known, 1] = np.maximum(x.reach_m[:known, 1], past[:, 1])
        return wall_of

    def candidates(self, x: Unknowns, m: Measured, seen: Sightings, gate: Gate) -> Candidates:
        """All pairs within the gate.

        First by geometry alone, for all hits and walls; then by the noise, for the few left.
        """
        hit, wall, cos_incidence = _facing(x, seen, gate.along_m)
        beam, units = m.beam[hit], self.units
        distance_m = x.walls[wall, 1] - (seen.eyes[hit] * x.normals[wall]).sum(axis=1)
        expected_m = distance_m / cos_incidence - m.mount_m[hit]
        sigma_m = units.sigma_m(beam, expected_m)
        # Near the end of the range long readings are missing, which would pull walls closer.
        inside = expected_m > units.min_m[beam]
        inside &= expected_m < units.max_m[beam] - NEAR_END_SIGMAS * sigma_m
        unbiased_m = (1 - x.range_gain[beam]) * m.distance_m[hit]
        misfit = np.abs(units.signal(beam, unbiased_m) - units.signal(beam, expected_m))
        misfit /= 1 + gate.across_m / (GATE_SIGMAS * sigma_m * cos_incidence)
        inside &= misfit < GATE_SIGMAS
        hit, wall, misfit = hit[inside], wall[inside], misfit[inside]
        order = np.lexsort((-_agreement(m, hit, wall, UNEXPLAINED - misfit**2), hit))
        return Candidates(len(m.frame), hit[order], wall[order], misfit[order])


def _agreement(m: Measured, hit: Indices, wall: Indices, gain: Array) -> Array:
    """(p,): what each pair explains together with the beam's hits just before and after.

    What a beam sweeps over from one moment to the next is mostly the same wall; one hit by itself
    may lie nearer to another that passes by.
    """
    by_beam = np.lexsort((np.arange(len(m.beam)), m.beam))
    apart = np.diff(m.beam[by_beam], prepend=-1) != 0
    apart |= np.diff(m.frame[by_beam], prepend=0) > 1
    rank = np.empty(len(m.beam), dtype=np.int64)
    rank[by_beam] = np.cumsum(1 + NEIGHBOURS * apart)
    key = wall * (rank.max(initial=0) + NEIGHBOURS + 1) + rank[hit]
    order = np.argsort(key, kind="stable")
    sorted_key, sorted_gain = key[order], gain[order]
    total: Array = gain.copy()
    for shift in (*range(-NEIGHBOURS, 0), *range(1, NEIGHBOURS + 1)):
        place = np.minimum(np.searchsorted(sorted_key, key + shift), max(len(key) - 1, 0))
        total += np.where(sorted_key[place] == key + shift, sorted_gain[place], 0.0)
    return total


def _facing(x: Unknowns, seen: Sightings, along_m: float) -> tuple[Indices, Indices, Array]:
    """Pairs of a hit and a wall whose front the beam met, so far beyond its ends: (p,), (p,).

    And the cosines of the beams' incidence, (p,).
    """
    step = max(1, CELLS_AT_ONCE // max(len(x.walls), 1))
    hits, walls, cosines = [], [], []
    for low in range(0, len(seen.beams), step):
        cos_incidence = seen.beams[low : low + step] @ x.normals.T
        usable = cos_incidence > LEAST_COS_INCIDENCE
        if math.isfinite(along_m):
            along = seen.points[low : low + step] @ x.tangents.T
            usable &= along > x.reach_m[:, 0] - along_m
            usable &= along < x.reach_m[:, 1] + along_m
        hit, wall = np.nonzero(usable)
        hits.append(hit + low)
        walls.append(wall)
        cosines.append(cos_incidence[hit, wall])
    if not hits:
        return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
    return np.concatenate(hits), np.concatenate(walls), np.concatenate(cosines)


def _merge(x: Unknowns, seen: Sightings, sigma_m: Array, wall_of: Indices, known: int) -> bool:
    """Make one of walls that are one; keep none without hits. Whether that changed any.

    Two are one if they go on where the other ends, or nearly, and a common line fits the hits of
    each as well as their noise allows: rooms in a row often have walls that are nearly in line. A
    known wall stays where it is; a new one that is the same goes.
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
            common = line if i < known else _fitted(line, seen.points[both], sigma_m[both])
            sets = [mine] if i < known else [members[i], mine]
            costs = [_mean_cost(common, seen.points[hits], sigma_m[hits]) for hits in sets]
            if max(costs) < MOST_MEAN_COST:
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


def _fitted(line: Array, points: Array, sigma_m: Array) -> Array:
    """The line moved and turned to fit the points best; it is nearly there already."""
    normal = np.array([math.cos(line[0]), math.sin(line[0])])
    along = points @ (-normal[1], normal[0])
    slope, across_m = np.polyfit(along, points @ normal, 1, w=1 / sigma_m)
    turned_rad = math.atan(slope)
    return np.array([line[0] - turned_rad, across_m * math.cos(turned_rad)])


def _mean_cost(line: Array, points: Array, sigma_m: Array) -> float:
    """χ² of points about a line by their number, each at most that of an unexplained one."""
    if not len(points):
        return 0.0
    across_m = points @ (math.cos(line[0]), math.sin(line[0])) - line[1]
    return float(np.minimum((across_m / sigma_m) ** 2, UNEXPLAINED).mean())


def _one_wall_a_stretch(x: Unknowns, seen: Sightings, pairs: Candidates) -> Candidates:
    """Where two walls lie so close that a hit may be on either, it is on that which has more there.

    One of them would hide the other. A line that is nearly that of a wall takes a share of its hits
    wherever they come near to each other, and may live on those alone.
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
        stretch = np.floor(seen.points @ x.tangents[one] / STRETCH_M).astype(np.int64)
        stretch -= stretch.min()
        size = int(stretch.max()) + 1
        mine = np.bincount(stretch[wall_of == one], minlength=size)
        theirs = np.bincount(stretch[wall_of == other], minlength=size)
        at = stretch[either]
        may_be[either[mine[at] > theirs[at]], other] = False
        may_be[either[mine[at] < theirs[at]], one] = False
    return pairs.only(may_be[pairs.hit, pairs.wall])


def _without_strays(
    x: Unknowns, seen: Sightings, pairs: Candidates, support: Support
) -> Candidates:
    """Without hits on a wall that goes by there only as a line.

    A piece far from the main one must be worth it by itself; where the line crosses another
    wall, it is not.
    """
    hit, wall, worth = pairs.worths()
    along = (seen.points[hit] * x.tangents[wall]).sum(axis=1)
    order = np.lexsort((along, wall))
    hit, wall, worth, along = hit[order], wall[order], worth[order], along[order]
    is_first = (np.diff(wall, prepend=NO_WALL) != 0) | (np.diff(along, prepend=0) > LARGEST_GAP_M)
    piece = np.cumsum(is_first) - 1
    of_piece = wall[is_first]
    worths = np.bincount(piece, worth, len(of_piece))
    hits = np.bincount(piece, minlength=len(of_piece))
    main = np.zeros(len(x.walls))
    np.maximum.at(main, of_piece, worths)
    stray = (worths < main[of_piece]) & (worths < support.needed(hits))
    strayed = np.full(len(seen.points), NO_WALL)
    strayed[hit[stray[piece]]] = wall[stray[piece]]
    return pairs.only(strayed[pairs.hit] != pairs.wall)


def _without_bends(
    x: Unknowns, seen: Sightings, sigma_m: Array, pairs: Candidates, known: int
) -> Candidates:
    """Walls cut where the hits on them bend away; what is cut off may show another wall."""
    wall_of = pairs.best()
    cut_off = np.full(len(wall_of), NO_WALL)
    for wall in range(known, len(x.walls)):
        mine: Indices = np.flatnonzero(wall_of == wall)
        for _ in range(MOST_CUTS):
            if len(mine) < 2:
                break
            along = seen.points[mine] @ x.tangents[wall]
            line = _fitted(x.walls[wall], seen.points[mine], sigma_m[mine])
            across = seen.points[mine] @ (math.cos(line[0]), math.sin(line[0])) - line[1]
            bent = bend(along, across, sigma_m[mine])
            if bent.is_straight:
                break
            kept = longer_side(along, bent.worst_m)
            cut_off[mine[~kept]] = wall
            mine = mine[kept]
    return pairs.only(cut_off[pairs.hit] != pairs.wall)


def _worthy(
    x: Unknowns, seen: Sightings, pairs: Candidates, support: Support, known: int
) -> tuple[Candidates, Indices]:
    """The walls that are worth having; the least worthy is taken out first, then all is redone."""
    kept = np.arange(len(x.walls))
    while len(kept) > known:
        hit, wall, worth = pairs.worths()
        hits = np.bincount(wall, minlength=len(x.walls)).astype(float)
        worths = np.bincount(wall, worth, len(x.walls)) / support.needed(hits)
        along = (seen.points[hit] * x.tangents[wall]).sum(axis=1)
        low, high = np.full(len(x.walls), np.inf), np.full(len(x.walls), -np.inf)
        np.minimum.at(low, wall, along)
        np.maximum.at(high, wall, along)
        worths[(hits < support.hits) | (high - low < support.extent_m)] = 0.0
        judged = kept[kept >= known]
        least = judged[int(worths[judged].argmin())]
        if worths[least] >= 1 and len(kept) <= MOST_WALLS:
            break
        gone = judged[worths[judged] <= 0] if worths[least] <= 0 else np.array([least])
        kept = np.setdiff1d(kept, gone)
        pairs = pairs.only(~np.isin(pairs.wall, gone))
    return pairs, kept

"""Which walls each hit may be on, by where its beam went and how noisy it is."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import Array, Indices, Measured, Sightings, Unknowns

Mask = NDArray[np.bool_]

GATE_SIGMAS = 3.0
UNEXPLAINED = GATE_SIGMAS**2
"""χ² of a hit that fits no wall."""
MIN_COS_INCIDENCE = math.cos(math.radians(70))
NEAR_END_SIGMAS = 2.0
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

    def without(self, wrong: Mask, wall_of: Indices) -> "Candidates":
        """Without pairs of hits of the mask (n,) and their walls (n,); they may be on others."""
        return self.only(~(wrong[self.hit] & (wall_of[self.hit] == self.wall)))

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


def candidates(
    x: Unknowns, m: Measured, seen: Sightings, units: RangeUnits, gate: Gate
) -> Candidates:
    """All pairs within the gate.

    First by geometry alone, for all hits and walls; then by the noise, for the few left.
    """
    hit, wall, cos_incidence = _facing(x, seen, gate.along_m)
    beam = m.beam[hit]
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
        usable = cos_incidence > MIN_COS_INCIDENCE
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

"""Finds the candidate walls of each hit, by beam geometry and range noise."""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import Measured, Rays, Unknowns, unbiased_m

GATE_SIGMAS = 3.0
"""Largest residual of a hit on its wall, in sigmas. Chosen."""
UNEXPLAINED = GATE_SIGMAS**2
"""χ² of a hit that fits no wall."""
MIN_COS_INCIDENCE = math.cos(math.radians(70))
"""Cosine of the largest incidence of a hit on its wall. Chosen: 70°."""
NEAR_END_SIGMAS = 2.0
"""Expected ranges within this many sigmas of the maximum range are not used. Chosen."""
NEIGHBOURS = 3
"""This many hits of a beam before and after a hit influence its association. Chosen."""
CELLS_AT_ONCE = 1_000_000
"""Hits times walls processed together; bounds the memory. Chosen."""


@dataclass(frozen=True, slots=True)
class Gate:
    """Largest distance of a hit from a wall to be associated with it."""

    across_m: float
    """Across the wall's line, in addition to three sigmas of the range: the error of the poses,
    m."""
    along_m: float = math.inf
    """Largest distance beyond the wall's ends, m."""
    detect_keyframes: int = 0
    """New walls are detected among the hits of this many keyframes at a time; 0: no detection."""
    prunes_see_through: bool = False
    """The poses are exact enough to find beams through walls, and bends."""


@dataclass(frozen=True, slots=True)
class Candidates:
    """Pairs of a hit and a wall that it may be on, ordered by hits, the best wall first."""

    hits: int
    """Number of hits, including those without any wall."""
    hit: Indices
    wall: Indices
    misfit: Array
    """Residual in widened sigmas, below `GATE_SIGMAS`."""

    def only(self, kept: Mask) -> "Candidates":
        """The pairs selected by the mask (pairs,)."""
        return replace(self, hit=self.hit[kept], wall=self.wall[kept], misfit=self.misfit[kept])

    def without(self, wrong: Mask, wall_of: Indices) -> "Candidates":
        """Drop the pairs of masked hits (n,) and their walls (n,).

        Other walls of these hits stay.
        """
        return self.only(~(wrong[self.hit] & (wall_of[self.hit] == self.wall)))

    @property
    def is_best(self) -> Mask:
        """(pairs,): the first pair of each hit."""
        first: Mask = np.diff(self.hit, prepend=-1) > 0
        return first

    def best(self) -> Indices:
        """(n,): the best wall of each hit, or NO_WALL."""
        first = self.is_best
        wall_of = np.full(self.hits, NO_WALL)
        wall_of[self.hit[first]] = self.wall[first]
        return wall_of

    def worths(self) -> tuple[Indices, Indices, Array]:
        """Hits with a wall: index of the hit, its wall, and the χ² that the wall saves."""
        first = np.flatnonzero(self.is_best)
        second = np.append(self.misfit[1:], 0.0)[first] ** 2
        has_second = np.append(self.hit[1:], -1)[first] == self.hit[first]
        without = np.where(has_second, second, UNEXPLAINED)
        return self.hit[first], self.wall[first], without - self.misfit[first] ** 2


_NO_PAIRS = np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
"""No hits, walls and misfits."""


def candidates(x: Unknowns, m: Measured, rays: Rays, units: RangeUnits, gate: Gate) -> Candidates:
    """All pairs within the gate.

    Geometry selects pairs of all hits and walls first; the noise is evaluated for these only.
    """
    pairing = _Pairing(x, m, rays, unbiased_m(x, m), units, gate)
    step = max(1, CELLS_AT_ONCE // max(len(x.walls), 1))
    parts = [pairing.within(slice(low, low + step)) for low in range(0, len(rays.beams), step)]
    hit, wall, misfit = (np.concatenate(each) for each in zip(_NO_PAIRS, *parts, strict=True))
    order = np.lexsort((-_agreement(m, hit, wall, UNEXPLAINED - misfit**2), hit))
    return Candidates(len(m.frame), hit[order], wall[order], misfit[order])


def _agreement(m: Measured, hit: Indices, wall: Indices, gain: Array) -> Array:
    """(p,): χ² that each pair explains together with the beam's preceding and following hits.

    Successive hits of a beam are mostly on the same wall. A single hit may be nearer to another
    wall that crosses there.
    """
    by_beam = np.lexsort((np.arange(len(m.beam)), m.beam))
    is_first = np.diff(m.beam[by_beam], prepend=-1) != 0
    is_first |= np.diff(m.frame[by_beam], prepend=0) > 1
    rank = np.empty(len(m.beam), dtype=np.int64)
    rank[by_beam] = np.cumsum(1 + NEIGHBOURS * is_first)
    key = wall * (rank.max(initial=0) + NEIGHBOURS + 1) + rank[hit]
    order = np.argsort(key, kind="stable")
    key, gain = key[order], gain[order]
    near = [key[apart:] - key[:-apart] <= NEIGHBOURS for apart in range(1, NEIGHBOURS + 1)]
    total = gain.copy()
    for apart in range(NEIGHBOURS, 0, -1):
        total[apart:] += np.where(near[apart - 1], gain[:-apart], 0.0)
    for apart in range(1, NEIGHBOURS + 1):
        total[:-apart] += np.where(near[apart - 1], gain[apart:], 0.0)
    agreed = np.empty_like(total)
    agreed[order] = total
    return agreed


@dataclass(frozen=True, slots=True)
class _Pairing:
    """Pairs a part of the hits with the walls; parts bound the memory."""

    x: Unknowns
    m: Measured
    rays: Rays
    distance_m: Array
    """(n,): distances without the gain errors of the range units."""
    units: RangeUnits
    gate: Gate

    def within(self, part: slice) -> tuple[Indices, Indices, Array]:
        """Pairs within the gate: hits, walls and misfits (p,)."""
        x, units, across_m = self.x, self.units, self.gate.across_m
        hit, wall, cos_incidence = self._facing(part)
        beam = self.m.beam[hit]
        away_m = x.walls[wall, 1] - (self.rays.origins[hit] * x.normals[wall]).sum(axis=1)
        expected_m = away_m / cos_incidence - self.m.mount_m[hit]
        sigma_m = units.sigma_m(beam, expected_m)
        # Long readings are missing near the end of the range, which would bias walls closer.
        inside = expected_m > units.min_m[beam]
        inside &= expected_m < units.max_m[beam] - NEAR_END_SIGMAS * sigma_m
        misfit = units.signal(beam, self.distance_m[hit]) - units.signal(beam, expected_m)
        misfit = np.abs(misfit) / (1 + across_m / (GATE_SIGMAS * sigma_m * cos_incidence))
        inside &= misfit < GATE_SIGMAS
        return hit[inside], wall[inside], misfit[inside]

    def _facing(self, part: slice) -> tuple[Indices, Indices, Array]:
        """Pairs of a hit and a wall whose front the beam reached, not too far beyond its ends.

        Returns hits (p,), walls (p,) and the cosines of the incidence (p,).
        """
        x, along_m = self.x, self.gate.along_m
        cos_incidence = self.rays.beams[part] @ x.normals.T
        usable = cos_incidence > MIN_COS_INCIDENCE
        if math.isfinite(along_m):
            along = self.rays.points[part] @ x.tangents.T
            usable &= along > x.reach_m[:, 0] - along_m
            usable &= along < x.reach_m[:, 1] + along_m
        hit, wall = np.nonzero(usable)
        return hit + part.start, wall, cos_incidence[hit, wall]

"""Steps in what one beam meets, as at a pilaster: two surfaces, however near to each other.

From one reading to the next the drone moves by what odometry tells, to some millimetres. Where the
hits of a beam on one wall jump across it by more than that and the noise of the range allow, the
beam has gone over to another surface:

    hits     . ' . ' .                 . ' . '
                       ' . ' . ' . '
             on the wall, before it, and on the wall again

A line through both would fit each hit within what the poses may be off, and turn the heading by
degrees.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.odometry_model import OdometryModel, wander_kept
from companion.estimation.smoothing.state import (
    Array,
    Indices,
    Measured,
    Sightings,
    Unknowns,
    to_ned,
)

Mask = NDArray[np.bool_]

SIDE_HITS = 5
"""So many hits before a step are compared with as many after it: a quarter of a second at 20 Hz.
Chosen: of fewer the mean is too noisy, more are too far from the step."""
MIN_SIDE_HITS = 3
"""On either side, or one stray hit would make a step. Chosen."""
MAX_APART_KEYFRAMES = 5
"""Hits more than a second apart do not follow each other. Chosen: odometry walks by 16 mm in it."""
STEP_SIGMAS = 4.0
"""Noise alone makes one such step in some thousand hits, and some hits are lost to it. One of 15 cm
stands out by 7 sigmas at 2 m; a missed one costs degrees. Chosen: `benchmarks/pilasters.py` prints
3.8, 4.1 and 5.0 deg in the mean with 4, 4.5 and 5."""
MIN_STEP_M = 0.06
"""Chosen: plaster, skirting and rough walls stand out by less."""
ACCELERATION_M_S2 = 1.0
"""Unknown acceleration while odometry is late: what extrapolates by the last velocity is off by
½·a·t². Chosen: as hard as the autopilots brake (docs/autopilot.md)."""
NORMAL_SIGMA_RAD = math.radians(2)
"""Sigma of a wall's direction in flight; chosen. Along a wall whose direction is taken wrongly hits
climb across it, which is no step."""


@dataclass(frozen=True, slots=True)
class Steps:
    """Looks for steps in the hits (n,) as odometry alone places them."""

    beam: Indices
    """(n,)."""
    frame: Indices
    """(n,): the keyframe of each."""
    time_s: Array
    """(n,): when that was, since the first keyframe."""
    points: Array
    """(n, 2): in a frame that drifts as odometry does, turned as local NED."""
    sigma_m: Array
    """(n,): of the ranges."""
    late_m: Array
    """(n,): of what is extrapolated since the last odometry; the same for hits that follow."""
    odometry: OdometryModel

    @classmethod
    def of(
        cls, x: Unknowns, m: Measured, seen: Sightings, sigma_m: Array, odometry: OdometryModel
    ) -> "Steps":
        """Headings and scales as the unknowns have them."""
        moved_m = to_ned((1 + x.odometry_scale) * m.moved_frd_m, x.poses[:-1, 2])
        track = np.concatenate([np.zeros((1, 2)), np.cumsum(moved_m, axis=0)])
        points = (track - x.poses[:, :2])[m.frame] + seen.points
        late_s = np.zeros(len(points)) if m.late_s is None else m.late_s
        late_m = 0.5 * ACCELERATION_M_S2 * late_s**2
        return cls(m.beam, m.frame, m.time_s[m.frame], points, sigma_m, late_m, odometry)

    def beside(self, wall_of: Indices, walls: Array) -> Mask:
        """(n,): hits on their walls (w, 2) that lie a step beside most of their stream."""
        streams = _Streams.of(self.beam, self.frame, wall_of)
        step_m = self._steps(streams, walls[wall_of[streams.hit], 0])
        beside = np.zeros(len(wall_of), dtype=bool)
        total_m = np.cumsum(step_m)
        for first in np.unique(streams.first[step_m != 0]):
            stream = slice(first, streams.end[first])
            level_m = total_m[stream]
            near = np.abs(level_m[:, None] - np.unique(level_m)) < MIN_STEP_M
            beside[streams.hit[stream]] = ~near[:, near.sum(axis=0).argmax()]
        return beside

    def part(self, one: Indices, other: Indices, normal_rad: float) -> bool:
        """Whether a beam goes over a step from these hits to the others."""
        side = np.full(len(self.beam), NO_WALL)
        side[one] = side[other] = 0
        streams = _Streams.of(self.beam, self.frame, side)
        step_m = self._steps(streams, np.full(len(streams.hit), normal_rad))
        side[other] = 1
        change = streams.apart(side[streams.hit].astype(float))
        return bool((np.abs(change[step_m != 0]) > 0.5).any())

    def _steps(self, streams: "_Streams", normal_rad: Array) -> Array:
        """(h,): by how much the stream goes on farther out from each hit on; 0 where it does not.

        `normal_rad` (h,) are the directions of the walls.
        """
        cos, sin = np.cos(normal_rad), np.sin(normal_rad)
        north_m, east_m = self.points[streams.hit].T
        step_m = streams.apart(cos * north_m + sin * east_m)
        climbed_m = NORMAL_SIGMA_RAD * streams.apart(cos * east_m - sin * north_m)
        lasted_s = np.abs(streams.apart(self.time_s[streams.hit]))
        noise_m2 = self.sigma_m[streams.hit] ** 2 * streams.shares
        walked_m2 = self.odometry.step_variance_m2_per_s * lasted_s
        wandered_m2 = 2 * self.odometry.wander_m**2 * (1 - wander_kept(lasted_s))
        late_m = streams.around(self.late_m[streams.hit])
        sigma_m = np.sqrt(noise_m2 + walked_m2 + wandered_m2 + climbed_m**2 + late_m**2)
        sigmas = np.where(streams.is_inside, np.abs(step_m) / sigma_m, 0.0)
        is_step = (sigmas > STEP_SIGMAS) & (np.abs(step_m) > MIN_STEP_M)
        is_step &= sigmas >= maximum_filter1d(sigmas, 2 * SIDE_HITS + 1)
        return np.where(is_step, step_m, 0.0)


@dataclass(frozen=True, slots=True)
class _Streams:
    """Hits that follow each other in one beam and on one wall, stream after stream."""

    hit: Indices
    """(h,)."""
    first: Indices
    """(h,): where in this order the stream of each begins,"""
    end: Indices
    """(h,): and where the next one does."""
    before: Indices
    """(h,): so many hits just before each are compared,"""
    after: Indices
    """(h,): with so many from it on."""

    @classmethod
    def of(cls, beam: Indices, frame: Indices, wall_of: Indices) -> "_Streams":
        hit: Indices = np.flatnonzero(wall_of != NO_WALL)
        hit = hit[np.lexsort((hit, beam[hit], wall_of[hit]))]
        begins = (np.diff(wall_of[hit], prepend=-1) != 0) | (np.diff(beam[hit], prepend=-1) != 0)
        begins |= np.diff(frame[hit], prepend=0) > MAX_APART_KEYFRAMES
        begin: Indices = np.flatnonzero(begins)
        number, here = np.cumsum(begins) - 1, np.arange(len(hit))
        first, end = begin[number], np.append(begin[1:], len(hit))[number]
        before, after = np.minimum(here - first, SIDE_HITS), np.minimum(end - here, SIDE_HITS)
        return cls(hit, first, end, before, after)

    @property
    def is_inside(self) -> Mask:
        """(h,): there are enough hits on both sides."""
        inside: Mask = np.minimum(self.before, self.after) >= MIN_SIDE_HITS
        return inside

    @property
    def shares(self) -> Array:
        """(h,): variance of the difference of both means, of hits with variance 1."""
        shares: Array = 1 / np.maximum(self.before, 1) + 1 / self.after
        return shares

    def apart(self, value: Array) -> Array:
        """(h,): mean of the values (h,) from each hit on less the mean of those before it."""
        before, after = self._means(value)
        return after - before

    def around(self, value: Array) -> Array:
        """(h,): the same means added up."""
        before, after = self._means(value)
        return before + after

    def _means(self, value: Array) -> tuple[Array, Array]:
        """(h,) each: of the values (h,) before each hit, and from it on."""
        here = np.arange(len(self.hit))
        total = np.concatenate([[0.0], np.cumsum(value)])
        after = (total[here + self.after] - total[here]) / self.after
        before = (total[here] - total[here - self.before]) / np.maximum(self.before, 1)
        return before, after

"""Detects steps in the hits of one beam, as at a pilaster, which separate two near surfaces.

From one reading to the next the drone moves by the odometry's displacement, known to millimetres.
Where the hits of a beam on one wall jump across it by more than that and the range noise allow, the
beam has reached another surface:

    hits     . ' . ' .                 . ' . '
                       ' . ' . ' . '
             on the wall, before it, and on the wall again

A line through both surfaces would fit each hit within the error of the poses, and would turn the
heading by degrees.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d

from companion.core.arrays import Array, Indices, Mask
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.odometry_model import OdometryModel, wander_kept
from companion.estimation.smoothing.state import Measured, Rays, Unknowns, by_odometry_m

SIDE_HITS = 5
"""Hits compared before and after a step: a quarter of a second at 20 Hz. Chosen: the mean of fewer
hits is too noisy, more hits are too far from the step."""
MIN_SIDE_HITS = 3
"""Least hits on either side. Chosen: one outlier must not make a step."""
MAX_APART_KEYFRAMES = 5
"""Hits with a longer pause are not successive, keyframes (one second). Chosen: odometry walks by 16
mm in this time."""
STEP_SIGMAS = 4.0
"""Threshold in sigmas. Noise alone exceeds it once in some thousand hits. A step of 15 cm at 2 m
has 7 sigmas. A missed step costs degrees. Chosen: `benchmarks/mapping/pilasters.py` prints a mean
heading error of 3.8, 4.1 and 5.0 deg with 4, 4.5 and 5."""
MIN_STEP_M = 0.06
"""Least step, m. Chosen: plaster, skirting and rough walls have smaller ones."""
ACCELERATION_M_S2 = 1.0
"""Unknown acceleration while odometry is late. Extrapolation by the last velocity has an error of
½·a·t². Chosen: as hard as the autopilots brake (docs/autopilot.md)."""
NORMAL_SIGMA_RAD = math.radians(2)
"""Sigma of a wall's direction in flight, rad. Chosen. Along a wall with a wrong direction hits
drift across it, which is not a step."""


@dataclass(frozen=True, slots=True)
class Steps:
    """Detects steps in hits (n,) placed by odometry alone."""

    beam: Indices
    """(n,): index in `BEAMS`."""
    frame: Indices
    """(n,): keyframe of each hit."""
    time_s: Array
    """(n,): time of each hit's keyframe since the first, s."""
    points: Array
    """(n, 2): position in a frame that drifts with the odometry and has the axes of local NED."""
    sigma_m: Array
    """(n,): sigma of each range."""
    late_m: Array
    """(n,): error of the extrapolation since the last odometry, common to successive hits."""
    odometry: OdometryModel

    @classmethod
    def of(
        cls, x: Unknowns, m: Measured, rays: Rays, sigma_m: Array, odometry: OdometryModel
    ) -> "Steps":
        """Place the hits with the headings and scales of the unknowns."""
        track = np.concatenate([np.zeros((1, 2)), np.cumsum(by_odometry_m(x, m), axis=0)])
        points = (track - x.poses[:, :2])[m.frame] + rays.points
        late_s = np.zeros(len(points)) if m.late_s is None else m.late_s
        late_m = 0.5 * ACCELERATION_M_S2 * late_s**2
        return cls(m.beam, m.frame, m.time_s[m.frame], points, sigma_m, late_m, odometry)

    def off_surface(self, wall_of: Indices, walls: Array) -> Mask:
        """(n,): True for hits on walls (w, 2) that are a step away from most of their stream."""
        streams = _Streams.of(self.beam, self.frame, wall_of)
        step_m = self._steps(streams, walls[wall_of[streams.hit], 0])
        off_surface = np.zeros(len(wall_of), dtype=bool)
        total_m = np.cumsum(step_m)
        for first in np.unique(streams.first[step_m != 0]):
            stream = slice(first, streams.end[first])
            level_m = total_m[stream]
            is_near = np.abs(level_m[:, None] - np.unique(level_m)) < MIN_STEP_M
            off_surface[streams.hit[stream]] = ~is_near[:, is_near.sum(axis=0).argmax()]
        return off_surface

    def separates(self, one: Indices, other: Indices, normal_rad: float) -> bool:
        """True if a beam crosses a step between these hits and the others."""
        side = np.full(len(self.beam), NO_WALL)
        side[one] = side[other] = 0
        streams = _Streams.of(self.beam, self.frame, side)
        step_m = self._steps(streams, np.full(len(streams.hit), normal_rad))
        side[other] = 1
        change = streams.mean_change(side[streams.hit].astype(float))
        return bool((np.abs(change[step_m != 0]) > 0.5).any())

    def _steps(self, streams: "_Streams", normal_rad: Array) -> Array:
        """(h,): height of the step at each hit, away from the drone, m; 0 without a step.

        `normal_rad` (h,): directions of the walls.
        """
        cos, sin = np.cos(normal_rad), np.sin(normal_rad)
        north_m, east_m = self.points[streams.hit].T
        step_m = streams.mean_change(cos * north_m + sin * east_m)
        slant_m = NORMAL_SIGMA_RAD * streams.mean_change(cos * east_m - sin * north_m)
        dt_s = np.abs(streams.mean_change(self.time_s[streams.hit]))
        noise_m2 = self.sigma_m[streams.hit] ** 2 * streams.shares
        walked_m2 = self.odometry.step_variance_m2_per_s * dt_s
        wandered_m2 = 2 * self.odometry.wander_m**2 * (1 - wander_kept(dt_s))
        late_m = streams.mean_sum(self.late_m[streams.hit])
        sigma_m = np.sqrt(noise_m2 + walked_m2 + wandered_m2 + slant_m**2 + late_m**2)
        sigmas = np.where(streams.is_inside, np.abs(step_m) / sigma_m, 0.0)
        is_step = (sigmas > STEP_SIGMAS) & (np.abs(step_m) > MIN_STEP_M)
        is_step &= sigmas >= maximum_filter1d(sigmas, 2 * SIDE_HITS + 1)
        return np.where(is_step, step_m, 0.0)


@dataclass(frozen=True, slots=True)
class _Streams:
    """Streams of successive hits of one beam on one wall, one after the other."""

    hit: Indices
    """(h,): index of each hit."""
    first: Indices
    """(h,): position in this order of the first hit of the same stream."""
    end: Indices
    """(h,): position of the first hit of the next stream."""
    before: Indices
    """(h,): number of hits compared before each hit."""
    after: Indices
    """(h,): number of hits compared from each hit on."""

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
        """(h,): True with enough hits on both sides."""
        inside: Mask = np.minimum(self.before, self.after) >= MIN_SIDE_HITS
        return inside

    @property
    def shares(self) -> Array:
        """(h,): variance of the difference of both means for hits with variance 1."""
        shares: Array = 1 / np.maximum(self.before, 1) + 1 / self.after
        return shares

    def mean_change(self, value: Array) -> Array:
        """(h,): mean of the values (h,) from each hit on, less the mean of those before it."""
        before, after = self._means(value)
        return after - before

    def mean_sum(self, value: Array) -> Array:
        """(h,): sum of the same means."""
        before, after = self._means(value)
        return before + after

    def _means(self, value: Array) -> tuple[Array, Array]:
        """(h,) each: means of the values (h,) before each hit, and from it on."""
        here = np.arange(len(self.hit))
        total = np.concatenate([[0.0], np.cumsum(value)])
        after = (total[here + self.after] - total[here]) / self.after
        before = (total[here] - total[here - self.before]) / np.maximum(self.before, 1)
        return before, after

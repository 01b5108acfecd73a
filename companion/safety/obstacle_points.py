"""Keeps the table of recent obstacle points near the drone, and updates it with later beams.

    put ─────────► a point ──── detected again: it stays, or moves to the new position
                      │
                      ├──────── beams passed through all of the strips around it ─► deleted
                      └──────── not detected again for long, or far away ─────────► deleted

The strips lie side by side across the passing beam. The point is in the middle strip.
"""

import math
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2, points_to_frd
from companion.core.values import value
from companion.safety.drift import DRIFT_SIGMAS, NO_DRIFT
from companion.safety.swept_space import LEG_M, SweptGrid

KEPT_S, KEPT_WITHIN_M = 120.0, 5.0
"""A point is deleted if it is not detected again for this time, s, or is farther than this from the
drone, m. The map still contains it. Chosen: by then the frame may have drifted by as much as the
clearance."""
VAGUE_SIGMAS = 2.0
"""An inexact point may lie this many sigmas before or behind its position, along its beam. Chosen:
a thin pole far away may not be detected again, because a swinging beam moves by 5 to 10 cm there
between two readings."""
SAME_SIGMAS = 3.0
"""An exact point within this many sigmas along the beam is the same obstacle. Chosen: one in twenty
readings of a jamb is more than two sigmas short, and would leave a point in the doorway."""
_SPAN = np.linspace(-1, 1, 13)
"""Relative positions along that interval that are tested for free space; mostly less than a cell
apart."""
SAME_M = 0.04
"""A detection within this distance of a point is the same point, m; the old position stays. Chosen:
otherwise a slowly turning beam would drag the points along, and only the edge of a jamb would
remain."""
OLD_S, SAME_OLD_M = 4.0, 0.10
"""A point older than this, s, may have drifted by this distance, m, or by more if odometry drifts
faster. A new point then replaces all points within it. Chosen: otherwise a jamb would appear twice,
once in its own doorway."""
STRIPS, STRIP_M, MIN_STRIPS_M, GUESS_STRIPS_M = 35, 0.01, 0.04, 0.02
"""Number of strips around a point, their width, m, and the distance from the point up to which they
must be free, m: for a sure point and for a guess. A beam frees a strip if the whole strip lies
within half the thinnest leg of it. It would have detected a leg with its centre there. Chosen."""
SEEN_THROUGH_M, FREED_WITHIN_S = 0.30, 10.0
"""A beam that continues this far beyond a point, m, frees its strip for this time, s. The point is
deleted when all strips are free up to `MIN_STRIPS_M` plus the possible drift: most beams that pass
a thin pole miss it. In the strips for the drift, a beam only has to end beyond the point: there it
may have met a wall close behind. A guess needs fewer strips, since the obstacle may not exist.
Chosen: the time covers two swings of the nose; later the strips drift over the obstacle."""
TOGETHER_M = 0.20
"""A point is deleted only if all points within this distance, m, are free too. Points that are
newer by `OLD_S` do not count: they are the same obstacle. Chosen: a beam that leaves a jamb passes
its edge as closely."""
NOT_FREED = (-math.inf,) * STRIPS
"""Initial times of the strips: no beam has passed."""
_STRIP_RIGHT_M = STRIP_M * (np.arange(STRIPS) - STRIPS // 2)
"""Offset of the middle of each strip from the point, to the right of the beam, m."""
ALONE_FROM_M, ALONE_TO_M, GLANCE_S = 0.06, 0.20, 3.0
"""A point is isolated if beams passed it on both sides at a distance in this interval, m, within
this time, s. It is then no wider than a leg, or the end of a thin obstacle. Chosen: the time is one
swing of the nose."""
ELSEWHERE_M = 0.15
"""Distance between two positions of the drone that count as different, m. If the drone comes nearer
by as much, a folded reading becomes longer, and its apparent position moves by more than
`fold_back.KNOWN_M`. Chosen: half as much again."""
LEGS_APART_M = 0.5
"""An isolated obstacle within this distance of a known leg is the same leg, m: it has drifted, or
belongs to the same furniture. Chosen."""
GOES_ON_M, GOES_ON_COS = (0.1, 0.2, 0.3), math.cos(math.radians(30))
"""An isolated point is the end of a surface, not a leg, if measured points stand between the first
two and between the last two of these distances from it, m, in the same direction within 30°.
Chosen: the legs of a chair are 0.35 m apart; the noise of an exact detection is below 0.1 m."""
_DETECTED_S, _KNOWN, _SIGMA_M, _RAY_RAD, _AGAIN_S, _LEFT_S, _RIGHT_S = 2, 3, 4, 5, 6, 7, 8
_FROM_NE, _FREED = slice(9, 11), 11
"""Columns of the table; see `ObstaclePoints`."""
GUESSED, TOO_STRONG, MEASURED = 0.0, 0.5, 1.0
"""Quality of a point. A signal stronger than at the minimum distance proves that an obstacle
exists, but not where. A reading that has probably folded back proves neither."""


@dataclass(frozen=True, slots=True)
class LineOfSight:
    """Path of a sensor's beam when the sensor measured, in the present body frame (FRD)."""

    eye_frd_m: Vector2
    bearing_rad: float
    along_m: Array
    """(n,): distance of each point along the beam, from its origin."""
    aside_m: Array
    """(n,): offset of each point to the right of the beam."""

    def at_m(self, along_m: float) -> Vector2:
        """Position at `along_m` on the beam, body FRD, m."""
        forward_m, right_m = self.eye_frd_m
        cos_b, sin_b = math.cos(self.bearing_rad), math.sin(self.bearing_rad)
        return forward_m + along_m * cos_b, right_m + along_m * sin_b


@value
class Detection:
    """A detection by a beam, and its quality."""

    known: float
    """One of `GUESSED`, `TOO_STRONG` and `MEASURED`."""
    sigma_m: float
    """Sigma of the distance; 0 for an exact point."""
    ray_rad: float
    """Heading of the beam."""
    from_ne_m: Vector2
    """Position of the sensor beam's origin when the sensor measured."""


class ObstaclePoints:
    """Table of obstacle points in a frame that only odometry moves.

    Each row has 11 + STRIPS columns:

    - 0, 1: north and east, m
    - 2: time of the first detection there, s
    - 3: quality: `GUESSED`, `TOO_STRONG` or `MEASURED`
    - 4, 5: sigma of the distance, m, 0 if exact; heading of the beam, rad
    - 6: time of the last detection, s
    - 7, 8: time at which a beam last passed on the left and on the right, s
    - 9, 10: north and east of the drone at the detection, m
    - from 11: time at which a beam last passed through each strip, s
    """

    def __init__(self) -> None:
        self._points: Array = np.empty((0, _FREED + STRIPS))
        self.drift = NO_DRIFT
        """Error model of odometry."""
        self.leg_detected_s = -math.inf
        """Time of the last detection of an isolated obstacle, s."""
        self.legs: Array = np.empty((0, 2))
        """(l, 2): first position of each isolated obstacle, north and east, m."""

    @property
    def places(self) -> Array:
        """Positions (n, 2): north and east, m."""
        return self._points[:, :2]

    @property
    def is_vague(self) -> Mask:
        """(n,): True for inexact points, which were detected from too far away."""
        vague: Mask = self._points[:, _SIGMA_M] > 0
        return vague

    @property
    def is_measured(self) -> Mask:
        """(n,): True for points that were measured exactly."""
        measured: Mask = (self._points[:, _KNOWN] == MEASURED) & ~self.is_vague
        return measured

    @property
    def is_sure(self) -> Mask:
        """(n,): True for points at which an obstacle certainly exists."""
        sure: Mask = self._points[:, _KNOWN] > GUESSED
        return sure

    def is_detected_from_elsewhere(self, points: Indices, ne_m: Vector2) -> Mask:
        """(m,): True for those of `points` (m,) detected from another position than `ne_m`.

        A folded reading is not confirmed from two positions: its apparent obstacle moves with the
        drone.
        """
        off_m = self._points[points, _FROM_NE] - ne_m
        elsewhere: Mask = (off_m * off_m).sum(axis=1) > ELSEWHERE_M**2
        return elsewhere

    def is_detected_before(self, time_s: float) -> Mask:
        """(n,): True for the points measured where they are before `time_s`, s."""
        old: Mask = self._points[:, _DETECTED_S] < time_s
        return old

    def drift_m(self, now_s: float) -> Array:
        """(n,): sigma of the drone's drift since each point was detected, m."""
        return self.drift.sigma_m(np.maximum(now_s - self._points[:, _DETECTED_S], 0.0))

    def nearest(self, ne_m: Vector2, yaw_rad: float, swept: SweptGrid) -> Array:
        """Points (n, 2), m, forward and right; inexact ones at their nearest possible position.

        That position lies along their beam, where no beam has passed since the detection.
        """
        places = self._points[:, :2].copy()
        vague = np.flatnonzero(self.is_vague)
        if not len(vague):
            return points_to_frd(places - ne_m, yaw_rad)
        ray_rad, most_m = self._points[vague, _RAY_RAD], self._points[vague, _SIGMA_M]
        offsets_m = (VAGUE_SIGMAS * most_m)[:, None] * _SPAN
        north_m = places[vague, :1] + offsets_m * np.cos(ray_rad)[:, None]
        east_m = places[vague, 1:] + offsets_m * np.sin(ray_rad)[:, None]
        away_m = np.hypot(north_m - ne_m[0], east_m - ne_m[1])
        detected_s = self._points[vague, _DETECTED_S, None]
        away_m[swept.when_s(north_m, east_m) > detected_s] += KEPT_WITHIN_M
        at = np.arange(len(vague)), away_m.argmin(axis=1)
        places[vague, 0], places[vague, 1] = north_m[at], east_m[at]
        return points_to_frd(places - ne_m, yaw_rad)

    def free_strips(self, time_s: float, line: LineOfSight, free_m: Vector2) -> None:
        """Update the strips with a beam that is free from `free_m[0]` to `free_m[1]`, m."""
        from_m, to_m = free_m
        # the strips end at 0.18 m, within the distance that counts as beside
        close = np.flatnonzero(np.abs(line.aside_m) < ALONE_TO_M)
        along_m, aside_m = line.along_m[close], line.aside_m[close]
        beyond = along_m > np.where(self._points[close, _KNOWN] > GUESSED, from_m, 0.0)
        left_m = to_m - (along_m + VAGUE_SIGMAS * self._points[close, _SIGMA_M])
        is_drift = np.abs(aside_m) > MIN_STRIPS_M
        is_past = beyond & (left_m > np.where(is_drift, 0.0, SEEN_THROUGH_M))
        if not is_past.any():
            return
        row, strip = np.nonzero(_through(aside_m[is_past]))
        self._points[close[is_past][row], _FREED + strip] = time_s
        is_beside = beyond & (left_m > SEEN_THROUGH_M) & (np.abs(aside_m) > ALONE_FROM_M)
        self._points[close[is_beside & (aside_m > 0)], _LEFT_S] = time_s
        self._points[close[is_beside & (aside_m < 0)], _RIGHT_S] = time_s

    def confirm(self, point: int, time_s: float, aside_m: float, there_ne_m: Vector2) -> None:
        """Confirm a point; move it to the beam's end if beams passed through its position.

        So the point does not slide along a surface that continues to either side.
        """
        self._points[point, _AGAIN_S] = time_s
        self._points[point, _FREED:][_through(np.array([aside_m]))[0]] = -math.inf
        if self._points[point, _FREED + STRIPS // 2] > time_s - FREED_WITHIN_S:
            self._points[point, :2] = there_ne_m
            self._points[point, _FREED:] = -math.inf

    def add(self, place_ne_m: Vector2, time_s: float, found: Detection) -> None:
        """Add a detection: a new point, unless a point of equal quality is there."""
        known, sigma_m, ray_rad = found.known, found.sigma_m, found.ray_rad
        off_m = self._points[:, :2] - place_ne_m
        off_m2 = (off_m * off_m).sum(axis=1)
        is_old = time_s - self._points[:, _DETECTED_S] > OLD_S
        is_better = (self._points[:, _KNOWN] >= known) & (self._points[:, _SIGMA_M] <= sigma_m)
        stays = ~is_old & (off_m2 < np.maximum(SAME_M, sigma_m) ** 2) & is_better
        if stays.any():
            alone = self._stands_alone(stays & self.is_measured, time_s)
            if alone and not self._ends_surface(place_ne_m):
                self._note_leg(place_ne_m, time_s)
            self._points[stays, _AGAIN_S] = time_s
            self._points[stays, _FREED:] = -math.inf
            return
        no_better = self._points[:, _KNOWN] <= known
        drift_m = self.drift_m(time_s)
        most_sigma_m = np.maximum(self._points[:, _SIGMA_M], sigma_m)
        apart_m = np.where(most_sigma_m > 0, np.hypot(most_sigma_m, drift_m), 0.0)
        is_exact = ~self.is_vague
        if (_lie_along(off_m, ray_rad, SAME_SIGMAS * apart_m) & is_better & is_exact).any():
            return  # within its uncertainty, the detection is that exact point
        old_m = np.maximum(SAME_OLD_M, DRIFT_SIGMAS * drift_m)
        same_m = np.maximum(np.where(is_old, old_m, SAME_M), VAGUE_SIGMAS * apart_m)
        rays_rad = self._points[:, _RAY_RAD]
        again = ~is_exact & _lie_along(off_m, rays_rad, SAME_SIGMAS * apart_m)
        again = (again | (off_m2 < same_m**2)) & no_better  # a guess replaces no measurement
        again &= self._points[:, _SIGMA_M] >= sigma_m
        how = known, sigma_m, ray_rad
        unpassed = -math.inf, -math.inf, *found.from_ne_m, *NOT_FREED
        new = *place_ne_m, time_s, *how, time_s, *unpassed
        self._points = np.vstack([self._points[~again], new])

    def _note_leg(self, place_ne_m: Vector2, time_s: float) -> None:
        self.leg_detected_s = time_s
        off_m = self.legs - place_ne_m
        if ((off_m * off_m).sum(axis=1) > LEGS_APART_M**2).all():
            self.legs = np.vstack([self.legs, place_ne_m])

    def _stands_alone(self, which: Mask, time_s: float) -> bool:
        """Return True if one of the selected points (n,) is isolated."""
        beside_s = self._points[which][:, (_LEFT_S, _RIGHT_S)]
        return bool((beside_s > time_s - GLANCE_S).all(axis=1).any())

    def _ends_surface(self, place_ne_m: Vector2) -> bool:
        """Return True if a surface goes on from a place, so that no leg stands there."""
        off_m = self.places[self.is_measured] - place_ne_m
        away_m = np.hypot(*off_m.T)
        from_m, middle_m, to_m = GOES_ON_M
        near = off_m[(away_m >= from_m) & (away_m < middle_m)]
        beyond = off_m[(away_m >= middle_m) & (away_m < to_m)]
        lengths_m2 = np.outer(np.hypot(*near.T), np.hypot(*beyond.T))
        return bool((near @ beyond.T > GOES_ON_COS * lengths_m2).any())

    def forget(self, ne_m: Vector2, now_s: float) -> None:
        """Delete the points that are far away or were not detected again for `KEPT_S`."""
        off_m = self._points[:, :2] - ne_m
        is_near = (off_m * off_m).sum(axis=1) < KEPT_WITHIN_M**2
        self._keep(is_near & (self._points[:, _AGAIN_S] > now_s - KEPT_S))

    def delete_freed(self, now_s: float) -> None:
        """Delete the points through which beams passed, together with all points close by."""
        self._keep(~self._gone(now_s))

    def _keep(self, kept: Mask) -> None:
        if not kept.all():
            self._points = self._points[kept]

    def _gone(self, now_s: float) -> Mask:
        """(n,): True for points through which beams passed."""
        is_through: Mask = self._points[:, _FREED + STRIPS // 2] > now_s - FREED_WITHIN_S
        if not is_through.any():  # the strip through the point must be free in any case
            return is_through
        within_m = MIN_STRIPS_M + DRIFT_SIGMAS * self.drift_m(now_s)
        within_m[~self.is_sure] = GUESS_STRIPS_M
        lately = self._points[:, _FREED:] > now_s - FREED_WITHIN_S
        passed = lately | (within_m[:, None] < np.abs(_STRIP_RIGHT_M))
        doubted = np.asarray(passed.all(axis=1))
        if not doubted.any():
            return doubted
        gone = doubted.copy()
        there = self._points[~doubted]
        for at in np.flatnonzero(doubted):
            off_m = there[:, :2] - self._points[at, :2]
            is_beside = (off_m * off_m).sum(axis=1) < TOGETHER_M**2
            is_newer = there[:, _DETECTED_S] > self._points[at, _DETECTED_S] + OLD_S
            gone[at] = not (is_beside & ~is_newer).any()
        return gone


def _lie_along(off_m: Array, ray_rad: float | Array, within_m: Array) -> Mask:
    """(n,): True where offsets (n, 2) from a point lie on a beam of that heading through it."""
    cos, sin = np.cos(ray_rad), np.sin(ray_rad)
    along_m = off_m[:, 0] * cos + off_m[:, 1] * sin
    aside_m = off_m[:, 1] * cos - off_m[:, 0] * sin
    lie: Mask = (np.abs(along_m) < within_m) & (np.abs(aside_m) < SAME_OLD_M)
    return lie


def _through(aside_m: Array) -> Mask:
    """(n, STRIPS): strips that a beam frees, for points (n,) at `aside_m` to its right."""
    through: Mask = np.abs(aside_m[:, None] - _STRIP_RIGHT_M) < LEG_M / 2 - STRIP_M / 2
    return through

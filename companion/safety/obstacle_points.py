"""Points that beams have met near the drone, and what later beams say of each: the table of them.

    put ─────────► a point ──── met again: it stays, or is moved to where it is met now
                      │
                      ├──────── beams went through all of the strips around it ─► gone
                      └──────── not met again for long, or far off ─────────────► forgotten

The strips lie side by side across the beam that goes by, the point in the middle one.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import Vector2, points_to_frd
from companion.core.values import value
from companion.safety.seen_free import LEG_M, Passed

Points = NDArray[np.float64]
Chosen = NDArray[np.bool_]

KEPT_S, KEPT_WITHIN_M = 120.0, 5.0
"""What is not met again for so long is left to the map: the frame may have drifted by as much as
the drone keeps off."""
VAGUE_SIGMAS = 2.0
"""What was met from farther off may be so far before or behind where it was met. A thin pole may
not be met again: between two readings of a beam that swings, it moves on by 5 to 10 cm there."""
SAME_SIGMAS = 3.0
"""What lies so near along the beam, and is known exactly, is what was met: of many readings of a
jamb one in twenty is more than two sigmas short, and would stand in the doorway."""
_SPAN = np.linspace(-1, 1, 13)
"""Where between it is looked whether beams have gone there, less than a cell apart mostly."""
SAME_M = 0.04
"""A point that is met again is one point, the old one: new ones in its stead would be drawn along
by a beam that turns slowly, and of a jamb nothing would be left but its edge."""
OLD_S, SAME_OLD_M = 4.0, 0.10
"""After so long it may have drifted by as much, or by more if odometry drifts faster, and a new one
stands for all that are so near. A jamb met long ago would stand in its own doorway beside itself.
"""
STRIPS, STRIP_M, MIN_STRIPS_M, GUESS_STRIPS_M = 35, 0.01, 0.04, 0.02
"""A beam goes through those of which no part is farther from it than half the thinnest leg: what
has its middle there would have been met."""
SEEN_THROUGH_M, PASSED_WITHIN_S = 0.30, 10.0
"""A beam that goes on so far beyond a point has shown that nothing is there any more, in one of so
many strips around it. Only when it did in all of them to this distance, and as far as the drone may
have drifted, is the point gone: a thin pole is missed by most beams that pass close by. A guess
goes at a smaller distance: it may never have been there. All within so long, two swings of the
nose: the strips drift over what stands there."""
DRIFT_SIGMAS = 2.0
"""The drone has drifted by no more, in 19 of 20 cases on either axis."""
TOGETHER_M = 0.20
"""It did so likewise for all points that are so near to it: a beam that leaves a jamb
goes past its edge as near as that. Where those were met later by OLD_S they are what it was."""
NOT_PASSED = (-math.inf,) * STRIPS
_STRIP_RIGHT_M = STRIP_M * (np.arange(STRIPS) - STRIPS // 2)
"""Of the middle of each strip from the point."""
ALONE_FROM_M, ALONE_TO_M, GLANCE_S = 0.06, 0.20, 3.0
"""What beams have gone by at such a distance on both sides, and beyond, within so long, one swing
of the nose, stands alone and is no wider than a leg, or the end of something thin."""
ELSEWHERE_M = 0.15
"""When the drone comes nearer by so much, a folded reading becomes longer: what it means moves on
by more than `fold_back.KNOWN_M`. Chosen: half as much again."""
LEGS_APART_M = 0.5
"""What stands alone and is met nearer to where one was met than this is that one, which has
drifted, or belongs to it. Chosen."""
_MET_S, _KNOWN, _SIGMA_M, _RAY_RAD, _AGAIN_S, _LEFT_S, _RIGHT_S = 2, 3, 4, 5, 6, 7, 8
_FROM_NE, _PASSED = slice(9, 11), 11
GUESSED, TOO_STRONG, MEASURED = 0.0, 0.5, 1.0
"""How well a point is known. A signal stronger than that of the least distance is proof that
something is there, not of where; a reading that seems to have folded back is proof of neither."""


@value
class Drift:
    """How odometry errs, as far as that is known."""

    scale_error: float = 0.0
    walk_m2_per_s: float = 0.0
    """On each axis,"""
    wander_m: float = 0.0
    """and the sigma of an error that comes and goes."""

    def sigma_m(self, age_s: Points) -> Points:
        """(n,): of how far the drone has drifted in so long."""
        wandered_m2 = np.where(age_s > 0, 2 * self.wander_m**2, 0.0)
        sigma_m: Points = np.sqrt(self.walk_m2_per_s * age_s + wandered_m2)
        return sigma_m


NO_DRIFT = Drift()


@dataclass(frozen=True, slots=True)
class LineOfSight:
    """Of sight: where the beam of a sensor went when it measured, body FRD as it is now."""

    eye_frd_m: Vector2
    bearing_rad: float
    along_m: Points
    """(n,): of the points, from the eye,"""
    aside_m: Points
    """(n,): and to the right of it."""

    def at_m(self, along_m: float) -> Vector2:
        """The place so far along it."""
        forward_m, right_m = self.eye_frd_m
        cos_b, sin_b = math.cos(self.bearing_rad), math.sin(self.bearing_rad)
        return forward_m + along_m * cos_b, right_m + along_m * sin_b


@value
class Found:
    """What a beam has met: how well that is known."""

    known: float
    """One of `GUESSED`, `TOO_STRONG` and `MEASURED`."""
    sigma_m: float
    """Of its distance; 0 where that is exact."""
    ray_rad: float
    """Heading of the beam."""
    from_ne_m: Vector2
    """Place of the drone when the sensor measured."""


class Met:
    """Points in a frame that only odometry moves.

    (n, 11 + STRIPS): north, east, when it was met there, how well it is known, the sigma of its
    distance where that was vague and the heading of the beam, when it was met again, when a beam
    last went by on the left and on the right of it, the north and east of the drone then,
    and when a beam last went through each of the strips around it.
    """

    def __init__(self) -> None:
        self._points: Points = np.empty((0, _PASSED + STRIPS))
        self._drift = NO_DRIFT
        self.leg_met_s = -math.inf
        """When something that stands alone was last met."""
        self.legs: Points = np.empty((0, 2))
        """(l, 2): where each such thing was met first."""

    def drifts(self, drift: Drift) -> None:
        """So odometry errs from now on."""
        self._drift = drift

    @property
    def places(self) -> Points:
        """(n, 2): north, east."""
        return self._points[:, :2]

    @property
    def is_vague(self) -> Chosen:
        """(n,): met too far off to be known exactly."""
        vague: Chosen = self._points[:, _SIGMA_M] > 0
        return vague

    @property
    def is_measured(self) -> Chosen:
        """(n,): and well."""
        measured: Chosen = (self._points[:, _KNOWN] == MEASURED) & ~self.is_vague
        return measured

    @property
    def is_sure(self) -> Chosen:
        """(n,): something is there."""
        sure: Chosen = self._points[:, _KNOWN] > GUESSED
        return sure

    def is_met_from_elsewhere(self, ne_m: Vector2) -> Chosen:
        """(n,): measured when the drone was elsewhere than at a place.

        What a folded reading means is not met from two places: it moves on with the drone.
        """
        off_m = self._points[:, _FROM_NE] - ne_m
        elsewhere: Chosen = (off_m * off_m).sum(axis=1) > ELSEWHERE_M**2
        return self.is_measured & elsewhere

    def before(self, time_s: float) -> Points:
        """(m, 2): those that were met earlier."""
        old: Points = self._points[self._points[:, _MET_S] < time_s, :2]
        return old

    def drift_m(self, now_s: float) -> Points:
        """(n,): sigma of how far the drone has drifted since each was met."""
        return self._drift.sigma_m(np.maximum(now_s - self._points[:, _MET_S], 0.0))

    def nearest(self, ne_m: Vector2, yaw_rad: float, passed: Passed) -> Points:
        """(n, 2), forward and right: vague ones where they may stand nearest, along their beam.

        But not where beams have gone since it was met.
        """
        places = self._points[:, :2].copy()
        vague = np.flatnonzero(self.is_vague)
        ray_rad, most_m = self._points[vague, _RAY_RAD], self._points[vague, _SIGMA_M]
        offsets_m = np.outer(VAGUE_SIGMAS * most_m, _SPAN)
        along = np.column_stack([np.cos(ray_rad), np.sin(ray_rad)])
        span = places[vague, None] + offsets_m[..., None] * along[:, None]
        away_m = np.hypot(*np.moveaxis(span - ne_m, -1, 0))
        met_s = self._points[vague, _MET_S, None]
        away_m[passed.when_s(span) > met_s] += KEPT_WITHIN_M
        places[vague] = span[np.arange(len(vague)), away_m.argmin(axis=1)]
        return points_to_frd(places - ne_m, yaw_rad)

    def pass_through(self, time_s: float, line: LineOfSight, free_m: Vector2) -> None:
        """A beam has shown that it is free from and to so far."""
        from_m, to_m = free_m[0], free_m[1] - SEEN_THROUGH_M
        beyond = line.along_m > np.where(self.is_sure, from_m, 0.0)
        farthest_m = line.along_m + VAGUE_SIGMAS * self._points[:, _SIGMA_M]
        is_past = beyond & (farthest_m < to_m)
        passed = is_past[:, None] & _through(line.aside_m)
        self._points[:, _PASSED:][passed] = time_s
        off_m = np.abs(line.aside_m)
        beside = is_past & (off_m > ALONE_FROM_M) & (off_m < ALONE_TO_M)
        self._points[beside & (line.aside_m > 0), _LEFT_S] = time_s
        self._points[beside & (line.aside_m < 0), _RIGHT_S] = time_s

    def meet_again(self, point: int, time_s: float, aside_m: float, there_ne_m: Vector2) -> None:
        """It still stands there, or where the beam is, if beams went through where it was.

        It does not move along a surface, then, that goes on to either side.
        """
        self._points[point, _AGAIN_S] = time_s
        self._points[point, _PASSED:][_through(np.array([aside_m]))[0]] = -math.inf
        if self._points[point, _PASSED + STRIPS // 2] > time_s - PASSED_WITHIN_S:
            self._points[point, :2] = there_ne_m
            self._points[point, _PASSED:] = -math.inf

    def put(self, place_ne_m: Vector2, time_s: float, found: Found) -> None:
        """Something was met there: a new point, unless it is one that is known as well."""
        known, sigma_m, ray_rad = found.known, found.sigma_m, found.ray_rad
        off_m = self._points[:, :2] - place_ne_m
        off_m2 = (off_m * off_m).sum(axis=1)
        is_old = time_s - self._points[:, _MET_S] > OLD_S
        no_better = self._points[:, _KNOWN] <= known
        drift_m = self.drift_m(time_s)
        most_sigma_m = np.maximum(self._points[:, _SIGMA_M], sigma_m)
        apart_m = np.where(most_sigma_m > 0, np.hypot(most_sigma_m, drift_m), 0.0)
        is_better = (self._points[:, _KNOWN] >= known) & (self._points[:, _SIGMA_M] <= sigma_m)
        stays = ~is_old & (off_m2 < np.maximum(SAME_M, sigma_m) ** 2) & is_better
        if stays.any():
            if self._stands_alone(stays & self.is_measured, time_s):
                self._note_leg(place_ne_m, time_s)
            self._points[stays, _AGAIN_S] = time_s
            self._points[stays, _PASSED:] = -math.inf
            return
        is_exact = ~self.is_vague
        if (_lie_along(off_m, ray_rad, SAME_SIGMAS * apart_m) & is_better & is_exact).any():
            return  # that is what it met, as far as it tells
        old_m = np.maximum(SAME_OLD_M, DRIFT_SIGMAS * drift_m)
        same_m = np.maximum(np.where(is_old, old_m, SAME_M), VAGUE_SIGMAS * apart_m)
        rays_rad = self._points[:, _RAY_RAD]
        again = ~is_exact & _lie_along(off_m, rays_rad, SAME_SIGMAS * apart_m)
        again = (again | (off_m2 < same_m**2)) & no_better  # no guess for what was measured
        again &= self._points[:, _SIGMA_M] >= sigma_m
        how = known, sigma_m, ray_rad
        unpassed = -math.inf, -math.inf, *found.from_ne_m, *NOT_PASSED
        new = *place_ne_m, time_s, *how, time_s, *unpassed
        self._points = np.vstack([self._points[~again], new])

    def _note_leg(self, place_ne_m: Vector2, time_s: float) -> None:
        self.leg_met_s = time_s
        off_m = self.legs - place_ne_m
        if ((off_m * off_m).sum(axis=1) > LEGS_APART_M**2).all():
            self.legs = np.vstack([self.legs, place_ne_m])

    def _stands_alone(self, which: Chosen, time_s: float) -> bool:
        """Whether one of some points (n,) that are met again does."""
        beside_s = self._points[which][:, (_LEFT_S, _RIGHT_S)]
        return bool((beside_s > time_s - GLANCE_S).all(axis=1).any())

    def forget(self, ne_m: Vector2, now_s: float) -> None:
        """What is far off, or was not met again for long."""
        off_m = self._points[:, :2] - ne_m
        is_near = (off_m * off_m).sum(axis=1) < KEPT_WITHIN_M**2
        self._points = self._points[is_near & (self._points[:, _AGAIN_S] > now_s - KEPT_S)]

    def let_go(self, now_s: float) -> None:
        """What beams went through, and through all that is close by."""
        self._points = self._points[~self._gone(now_s)]

    def _gone(self, now_s: float) -> Chosen:
        """(n,): beams went through it."""
        within_m = MIN_STRIPS_M + DRIFT_SIGMAS * self.drift_m(now_s)
        within_m[~self.is_sure] = GUESS_STRIPS_M
        lately = self._points[:, _PASSED:] > now_s - PASSED_WITHIN_S
        passed = lately | (within_m[:, None] < np.abs(_STRIP_RIGHT_M))
        doubted = np.asarray(passed.all(axis=1))
        if not doubted.any():
            return doubted
        gone = doubted.copy()
        there = self._points[~doubted]
        for at in np.flatnonzero(doubted):
            off_m = there[:, :2] - self._points[at, :2]
            is_beside = (off_m * off_m).sum(axis=1) < TOGETHER_M**2
            is_newer = there[:, _MET_S] > self._points[at, _MET_S] + OLD_S
            gone[at] = not (is_beside & ~is_newer).any()
        return gone


def _lie_along(off_m: Points, ray_rad: float | Points, within_m: Points) -> Chosen:
    """(n,): whether places (n, 2) off a point lie before or behind it on a beam of that heading."""
    cos, sin = np.cos(ray_rad), np.sin(ray_rad)
    along_m = off_m[:, 0] * cos + off_m[:, 1] * sin
    aside_m = off_m[:, 1] * cos - off_m[:, 0] * sin
    lie: Chosen = (np.abs(along_m) < within_m) & (np.abs(aside_m) < SAME_OLD_M)
    return lie


def _through(aside_m: Points) -> Chosen:
    """(n, STRIPS): strips that a beam goes through that has points (n,) so far to its right."""
    through: Chosen = np.abs(aside_m[:, None] - _STRIP_RIGHT_M) < LEG_M / 2 - STRIP_M / 2
    return through

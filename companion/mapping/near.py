"""What stands near the drone, as the beams met it a moment ago: what must not be hit.

The points are kept in a frame of their own that is only ever moved on, by odometry, and turned by
the gyro. A step of the estimate, or a wall that was taken for another, moves the map but not what
is near.

Readings that have folded back are called too near (`folds.py`). How near, they tell badly; what was
measured there before says it better.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from companion.frames import Vector2, frd_to_ned, ned_to_frd, points_to_frd, wrap_rad
from companion.mapping.folds import ALIAS_M, Folds
from companion.mapping.passed import Lane, Passed, all_passed
from companion.messages import (
    BEARING_FRD_RAD,
    FIRST_LAG_S,
    Beam,
    Odometry,
    RangeReading,
    RangeScan,
    RangeState,
    RangeUnit,
)
from companion.values import value

KEPT_S, KEPT_WITHIN_M = 120.0, 5.0
"""What is not met again for so long is left to the map: the frame may have drifted by as much as
the drone keeps off."""
WITHIN_M, MOST_SIGMA_M = 2.5, 0.06
"""What is met so near, and so exactly, is known in place of what was met before."""
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
STRIPS, STRIP_M, LEAST_STRIPS_M = 17, 0.02, 0.04
SEEN_THROUGH_M, PASSED_WITHIN_S = 0.30, 10.0
"""A beam that goes on so far beyond a point has shown that nothing is there any more, in one of so
many strips around it. Only when it did in all of them to this distance, and as far as the drone may
have drifted, is the point gone: a thin pole is missed by most beams that pass close by. All within
so long, two swings of the nose: the strips drift over what stands there."""
DRIFT_SIGMAS = 2.0
"""The drone has drifted by no more, in 19 of 20 cases on either axis."""
TOGETHER_M = 0.20
"""It did so likewise for all points that are so near to it: a beam that leaves a jamb
goes past its edge as near as that. Where those were met later by OLD_S they are what it was."""
ALIAS_ASIDE_M = 0.12
SURELY_M = 0.30
"""What is known to be farther by so much than a folded reading would mean was not what it met, even
if it has drifted. Somebody who has gone would stand in the way until all is forgotten."""
UNMEASURED_M = 0.55
"""From the drone's centre: where something is put that is too near to be measured and is new."""
Points = NDArray[np.float64]
NOT_PASSED = (-math.inf,) * STRIPS
_STRIP_ASIDE_M = STRIP_M * np.abs(np.arange(STRIPS) - STRIPS // 2)
"""Of the middle of each strip from the point."""
_MET_S, _KNOWN, _SIGMA_M, _RAY_RAD, _AGAIN_S, _PASSED = 2, 3, 4, 5, 6, 7
_GUESSED, _TOO_STRONG, _MEASURED = 0.0, 0.5, 1.0
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
class Surroundings:
    """What the guard needs to know, body FRD, from the drone's centre."""

    points_frd_m: Points = field(default_factory=lambda: np.empty((0, 2)))
    """(n, 2), forward and right; of what was met vaguely the nearest place where it may stand."""
    velocity_frd_m_s: Vector2 = (0.0, 0.0)
    lag_s: float = FIRST_LAG_S
    """How long the drone goes on at that when it is stopped."""
    is_vague: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(1, dtype=bool))
    """(n,), or (1,) for all."""
    drift_m: Points = field(default_factory=lambda: np.zeros(1))
    """(n,), or (1,) for all: sigma of how far the drone has drifted against them since."""
    recalled_frd_m: Points = field(default_factory=lambda: np.empty((0, 2)))
    """(r, 2): what was met longer ago, where the map has it."""
    lane: Callable[[float], Lane] = all_passed
    """What beams have gone through of the way to a bearing, FRD."""


class Near:
    """Points around the drone, in a frame of its own.

    (n, 7 + STRIPS): north, east, when it was met there, how well it is known, the sigma of its
    distance where that was vague and the heading of the beam, when it was met again, and when a
    beam last went through each of the strips around it.
    """

    def __init__(self, units: Mapping[Beam, RangeUnit]) -> None:
        self._units = units
        self._points: Points = np.empty((0, _PASSED + STRIPS))
        self._passed = Passed()
        self._folds = Folds(units)
        self._ne_m: Vector2 = (0.0, 0.0)
        self._yaw_rad = 0.0
        self._velocity_frd_m_s: Vector2 = (0.0, 0.0)
        self._odometry: Odometry | None = None
        self._drift = NO_DRIFT
        self._seen: tuple[float, float] | None = None
        """When it was looked last, and the heading then."""

    def surroundings(self, lag_s: float) -> Surroundings:
        return Surroundings(
            self._nearest(),
            self._velocity_frd_m_s,
            lag_s,
            self._points[:, _SIGMA_M] > 0,
            self._drift_m(),
            lane=self._lane,
        )

    def _lane(self, bearing_frd_rad: float) -> Lane:
        """What was met long ago is to be met again before the drone passes it."""
        bearing_rad = self._yaw_rad + bearing_frd_rad
        lane = self._passed.lane(self._ne_m, bearing_rad, self._now_s)
        old = self._points[self._points[:, _MET_S] < self._now_s - OLD_S, :2]
        return lane.beside(*points_to_frd(old - self._ne_m, bearing_rad).T)

    @property
    def _now_s(self) -> float:
        return self._seen[0] if self._seen else 0.0

    def _nearest(self) -> Points:
        """(n, 2), forward and right: vague ones where they may stand nearest, along their beam.

        But not where beams have gone since it was met.
        """
        places = self._points[:, :2].copy()
        vague = np.flatnonzero(self._points[:, _SIGMA_M] > 0)
        ray_rad, most_m = self._points[vague, _RAY_RAD], self._points[vague, _SIGMA_M]
        offsets_m = np.outer(VAGUE_SIGMAS * most_m, _SPAN)
        along = np.column_stack([np.cos(ray_rad), np.sin(ray_rad)])
        span = places[vague, None] + offsets_m[..., None] * along[:, None]
        away_m = np.hypot(*np.moveaxis(span - self._ne_m, -1, 0))
        met_s = self._points[vague, _MET_S, None]
        away_m[self._passed.when_s(span) > met_s] += KEPT_WITHIN_M
        places[vague] = span[np.arange(len(vague)), away_m.argmin(axis=1)]
        return points_to_frd(places - self._ne_m, self._yaw_rad)

    def _drift_m(self) -> Points:
        """(n,): sigma of how far the drone has drifted since each was met."""
        return self._drift.sigma_m(np.maximum(self._now_s - self._points[:, _MET_S], 0.0))

    def turn_to(self, heading_rad: float) -> None:
        """By the gyro alone, which never makes a step.

        Not by odometry: its heading is told late, and by a few hundredths of a second in a turn
        what was met a metre away moves aside by centimetres.
        """
        self._yaw_rad = heading_rad

    def move(self, odometry: Odometry, drift: Drift = NO_DRIFT) -> None:
        """The drone has moved on as odometry says, its scale corrected.

        Not as its pose: far ranges, and walls taken for others, pull that by decimetres in some
        seconds, odometry wanders by centimetres.
        """
        last, self._odometry = self._odometry, odometry
        self._drift = drift
        self._velocity_frd_m_s = ned_to_frd(*odometry.velocity_ned_m_s[:2], odometry.yaw_rad)
        if last is None:
            return
        (x, y, _), (last_x, last_y, _) = odometry.position_ned_m, last.position_ned_m
        scale = 1 + drift.scale_error
        body_m = ned_to_frd(scale * (x - last_x), scale * (y - last_y), odometry.yaw_rad)
        north_m, east_m = frd_to_ned(*body_m, self._yaw_rad)
        self._ne_m = self._ne_m[0] + north_m, self._ne_m[1] + east_m

    def see(self, scan: RangeScan) -> RangeScan:
        """Take in a sweep; the same with readings that have folded back called too near."""
        self._forget(scan.time_s)
        self._folds.move_to(self._ne_m, self._yaw_rad)
        relative, yaw_rate_rad_s = self._relative(), self._turns_rad_s(scan.time_s)
        readings = dict(scan.readings)
        met = []
        for beam in BEARING_FRD_RAD:
            unit, reading = self._units.get(beam), readings.get(beam)
            if unit is None or reading is None:
                continue
            line = self._line(unit, relative, yaw_rate_rad_s)
            is_on_it = (np.abs(line.aside_m) < ALIAS_ASIDE_M) & (line.along_m > 0)
            measured_m = line.along_m[is_on_it & self._is_measured]
            known_m = float(measured_m.min(initial=math.inf)) - unit.offset_m
            unfolded = readings[beam] = self._folds.unfolded(beam, reading, known_m)
            free_m = _free_m(unfolded, unit)
            self._pass_through(scan.time_s, line, free_m)
            bearing_rad = self._yaw_rad + line.bearing_rad
            self._passed.go(self._place(line.eye_frd_m), bearing_rad, free_m, scan.time_s)
            end = _end_m(unfolded, unit.offset_m)
            is_there = is_on_it & (self._points[:, _KNOWN] > _GUESSED)
            again = _met_again(unfolded, unit, line.along_m, is_there)
            if again is not None:
                self._meet_again(again, line, scan.time_s)
            elif end is not None:
                end_m, sigma_m = end
                how = _how_known(reading, unfolded), sigma_m, bearing_rad
                met.append((line.at_m(end_m), how))
        self._passed.stand(self._ne_m, scan.time_s)
        self._points = self._points[~self._gone(scan.time_s)]
        for place, how in met:
            self._put(place, scan.time_s, *how)
        self._folds.look(scan.time_s, scan.readings, readings)
        return replace(scan, readings=readings)

    def _line(self, unit: RangeUnit, relative: Points, yaw_rate_rad_s: float) -> "_Line":
        """From where the drone was, and turned to, when the sensor measured."""
        age_s = unit.model.mean_age_s
        bearing_rad = unit.bearing_frd_rad - age_s * yaw_rate_rad_s
        cos_b, sin_b = math.cos(bearing_rad), math.sin(bearing_rad)
        forward_m_s, right_m_s = self._velocity_frd_m_s
        eye_frd_m = -age_s * forward_m_s, -age_s * right_m_s
        from_eye = relative - eye_frd_m
        return _Line(eye_frd_m, bearing_rad, from_eye @ (cos_b, sin_b), from_eye @ (-sin_b, cos_b))

    def _pass_through(self, time_s: float, line: "_Line", free_m: Vector2) -> None:
        """A beam has shown that it is free from and to so far."""
        from_m, to_m = free_m[0], free_m[1] - SEEN_THROUGH_M
        beyond = line.along_m > np.where(self._points[:, _KNOWN] > _GUESSED, from_m, 0.0)
        farthest_m = line.along_m + VAGUE_SIGMAS * self._points[:, _SIGMA_M]
        strip = _strip(line.aside_m)
        passed = (strip >= 0) & (strip < STRIPS) & beyond & (farthest_m < to_m)
        self._points[passed, _PASSED + strip[passed]] = time_s

    def _meet_again(self, point: int, line: "_Line", time_s: float) -> None:
        """It still stands there, or where the beam is, if beams went through where it was.

        It does not move along a surface, then, that goes on to either side.
        """
        strip = np.clip(_strip(line.aside_m[point]), 0, STRIPS - 1)
        self._points[point, _AGAIN_S] = time_s
        self._points[point, _PASSED + strip] = -math.inf
        if self._points[point, _PASSED + STRIPS // 2] > time_s - PASSED_WITHIN_S:
            self._points[point, :2] = self._place(line.at_m(float(line.along_m[point])))
            self._points[point, _PASSED:] = -math.inf

    def _turns_rad_s(self, time_s: float) -> float:
        """By the headings now and when it was looked last."""
        last, self._seen = self._seen, (time_s, self._yaw_rad)
        if last is None or time_s <= last[0]:
            return 0.0
        return wrap_rad(self._yaw_rad - last[1]) / (time_s - last[0])

    def _gone(self, now_s: float) -> NDArray[np.bool_]:
        """(n,): through which beams went, and through all that is close by."""
        within_m = LEAST_STRIPS_M + DRIFT_SIGMAS * self._drift_m()
        within_m[self._points[:, _KNOWN] == _GUESSED] = STRIP_M  # it may never have been there
        lately = self._points[:, _PASSED:] > now_s - PASSED_WITHIN_S
        passed = lately | (within_m[:, None] < _STRIP_ASIDE_M)
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

    def _forget(self, now_s: float) -> None:
        points = self._points
        off_m = points[:, :2] - self._ne_m
        is_near = (off_m * off_m).sum(axis=1) < KEPT_WITHIN_M**2
        self._points = points[is_near & (points[:, _AGAIN_S] > now_s - KEPT_S)]

    @property
    def _is_measured(self) -> NDArray[np.bool_]:
        """(n,): and well."""
        measured: NDArray[np.bool_] = np.logical_and(
            self._points[:, _KNOWN] == _MEASURED, self._points[:, _SIGMA_M] == 0
        )
        return measured

    def _put(
        self, at_frd_m: Vector2, time_s: float, known: float, sigma_m: float, ray_rad: float
    ) -> None:
        place = self._place(at_frd_m)
        off_m = self._points[:, :2] - place
        off_m2 = (off_m * off_m).sum(axis=1)
        is_old = time_s - self._points[:, _MET_S] > OLD_S
        no_better = self._points[:, _KNOWN] <= known
        most_sigma_m = np.maximum(self._points[:, _SIGMA_M], sigma_m)
        apart_m = np.where(most_sigma_m > 0, np.hypot(most_sigma_m, self._drift_m()), 0.0)
        is_better = (self._points[:, _KNOWN] >= known) & (self._points[:, _SIGMA_M] <= sigma_m)
        stays = ~is_old & (off_m2 < np.maximum(SAME_M, sigma_m) ** 2) & is_better
        if stays.any():
            self._points[stays, _AGAIN_S] = time_s
            self._points[stays, _PASSED:] = -math.inf
            return
        is_exact = self._points[:, _SIGMA_M] == 0
        if (_lie_along(off_m, ray_rad, SAME_SIGMAS * apart_m) & is_better & is_exact).any():
            return  # that is what it met, as far as it tells
        old_m = np.maximum(SAME_OLD_M, DRIFT_SIGMAS * self._drift_m())
        same_m = np.maximum(np.where(is_old, old_m, SAME_M), VAGUE_SIGMAS * apart_m)
        rays_rad = self._points[:, _RAY_RAD]
        again = ~is_exact & _lie_along(off_m, rays_rad, SAME_SIGMAS * apart_m)
        again = (again | (off_m2 < same_m**2)) & no_better  # no guess for what was measured
        again &= self._points[:, _SIGMA_M] >= sigma_m
        self._points = np.vstack(
            [self._points[~again], (*place, time_s, known, sigma_m, ray_rad, time_s, *NOT_PASSED)]
        )

    def _place(self, at_frd_m: Vector2) -> Vector2:
        """In its own frame."""
        north_m, east_m = frd_to_ned(*at_frd_m, self._yaw_rad)
        return self._ne_m[0] + north_m, self._ne_m[1] + east_m

    def _relative(self) -> Points:
        """(n, 2), forward and right of the drone's centre."""
        return points_to_frd(self._points[:, :2] - self._ne_m, self._yaw_rad)


@dataclass(frozen=True, slots=True)
class _Line:
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


def _lie_along(off_m: Points, ray_rad: float | Points, within_m: Points) -> NDArray[np.bool_]:
    """(n,): whether places (n, 2) off a point lie before or behind it on a beam of that heading."""
    cos, sin = np.cos(ray_rad), np.sin(ray_rad)
    along_m = off_m[:, 0] * cos + off_m[:, 1] * sin
    aside_m = off_m[:, 1] * cos - off_m[:, 0] * sin
    lie: NDArray[np.bool_] = (np.abs(along_m) < within_m) & (np.abs(aside_m) < SAME_OLD_M)
    return lie


def _strip(aside_m: Points) -> NDArray[np.int64]:
    """Which of those around a point a beam goes through that has it so far to its right."""
    strip: NDArray[np.int64] = np.floor(aside_m / STRIP_M + STRIPS / 2).astype(np.int64)
    return strip


def _free_m(reading: RangeReading, unit: RangeUnit) -> Vector2:
    """Nothing lies along the beam from here to there.

    A reading that may have folded back says nothing of what it may have met then, nor of what is
    nearer, if that is more than a guess.
    """
    model = unit.model
    if reading.is_distance:
        alias_m = model.alias_m(reading.distance_m)
        end_m = reading.distance_m - 2 * math.sqrt(reading.variance_m2)
        from_m = 0.0 if alias_m is None else alias_m + unit.offset_m + SURELY_M
        return from_m, end_m + unit.offset_m
    if reading.state is RangeState.NOTHING:
        return 0.0, model.max_m
    return 0.0, 0.0


def _how_known(raw: RangeReading, unfolded: RangeReading) -> float:
    if unfolded.is_distance:
        return _MEASURED
    return _TOO_STRONG if raw.state is RangeState.TOO_NEAR else _GUESSED


def _met_again(
    reading: RangeReading, unit: RangeUnit, along_m: Points, is_on_it: NDArray[np.bool_]
) -> int | None:
    """Which of the points (n,) on a line of sight what is too near to be measured now was, if any.

    Its signal means one distance near the least that is measured, or one nearer than the peak.
    """
    if reading.state is not RangeState.TOO_NEAR or not is_on_it.any():
        return None
    guess_m = _guess_m(reading, unit.offset_m)
    alias_m = unit.model.alias_m(guess_m)
    from_unit_m = along_m - unit.offset_m
    off_m = np.abs(from_unit_m - guess_m)
    if alias_m is not None:
        off_m = np.minimum(off_m, np.abs(from_unit_m - alias_m))
    off_m = np.where(is_on_it, off_m, math.inf)
    likeliest = int(off_m.argmin())
    return likeliest if off_m[likeliest] <= ALIAS_M else None


def _guess_m(reading: RangeReading, offset_m: float) -> float:
    """From the sensor to what is too near."""
    return UNMEASURED_M - offset_m if math.isnan(reading.distance_m) else reading.distance_m


def _end_m(reading: RangeReading, offset_m: float) -> tuple[float, float] | None:
    """How far from the drone's centre something is, and its sigma where that is vague."""
    if reading.state is RangeState.TOO_NEAR:
        return _guess_m(reading, offset_m) + offset_m, 0.0
    if not reading.is_distance:
        return None
    sigma_m, end_m = math.sqrt(reading.variance_m2), reading.distance_m + offset_m
    is_exact = sigma_m < MOST_SIGMA_M and end_m < WITHIN_M
    return (end_m, 0.0 if is_exact else sigma_m) if end_m < KEPT_WITHIN_M else None

"""What stands near the drone, as the beams met it a moment ago: what must not be hit.

The points (`obstacle_points.py`) are kept in a frame of their own that is only ever moved on, by
odometry, and turned by the gyro. A step of the estimate, or a wall that was taken for another,
moves the map but not what is near.

Readings that have folded back are called too near (`fold_back.py`). How near, they tell badly; what
was measured there before says it better.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import Vector2, frd_to_ned, ned_to_frd, points_to_frd, wrap_rad
from companion.core.messages import (
    BEARING_FRD_RAD,
    FIRST_LAG_S,
    Beam,
    Odometry,
    RangeReading,
    RangeScan,
    RangeState,
    RangeUnit,
)
from companion.safety.fold_back import ALIAS_M, KNOWN_M, Folds
from companion.safety.obstacle_points import (
    GUESSED,
    KEPT_WITHIN_M,
    MEASURED,
    NO_DRIFT,
    OLD_S,
    TOO_STRONG,
    Drift,
    Found,
    LineOfSight,
    Met,
    Points,
)
from companion.safety.seen_free import NARROW, WIDE, Lane, Passed, all_passed

WITHIN_M, MAX_SIGMA_M = 2.5, 0.06
"""What is met so near, and so exactly, is known in place of what was met before."""
ALIAS_ASIDE_M = 0.12
SURELY_M = 0.30
"""What is known to be farther by so much than a folded reading would mean was not what it met, even
if it has drifted. Somebody who has gone would stand in the way until all is forgotten."""
AMONG_LEGS_S = 30.0
"""After a leg was met the drone is among legs for so long: chairs stand in groups."""
FURNISHED_LEGS = 4
"""After so many the building is furnished, and the drone is among legs for good. Measured: ends of
thin partitions are up to three of them in eleven flights without clutter, four and five things were
met in flights with a clutter of 0.25."""
UNMEASURED_M = 0.55
"""From the drone's centre: where something is put that is too near to be measured and is new."""


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
    is_among_legs: bool = False
    """Something thin that stands alone was met lately."""


class Near:
    """Points around the drone, in a frame of its own."""

    def __init__(self, units: Mapping[Beam, RangeUnit]) -> None:
        self._units = units
        self._met = Met()
        self._passed, self._proved = Passed(WIDE), Passed(NARROW)
        self._folds = Folds(units)
        self._ne_m: Vector2 = (0.0, 0.0)
        self._yaw_rad = 0.0
        self._velocity_frd_m_s: Vector2 = (0.0, 0.0)
        self._odometry: Odometry | None = None
        self._seen: tuple[float, float] | None = None
        """When it was looked last, and the heading then."""

    def surroundings(self, lag_s: float) -> Surroundings:
        return Surroundings(
            self._met.nearest(self._ne_m, self._yaw_rad, self._passed),
            self._velocity_frd_m_s,
            lag_s,
            self._met.is_vague,
            self._met.drift_m(self._now_s),
            lane=self._lane,
            is_among_legs=self._is_among_legs,
        )

    def _lane(self, bearing_frd_rad: float) -> Lane:
        """What was met long ago is to be met again before the drone passes it."""
        bearing_rad = self._yaw_rad + bearing_frd_rad
        passed = self._proved if self._is_among_legs else self._passed
        lane = passed.lane(self._ne_m, bearing_rad, self._now_s)
        old = self._met.before(self._now_s - OLD_S)
        return lane.beside(*points_to_frd(old - self._ne_m, bearing_rad).T)

    @property
    def _is_among_legs(self) -> bool:
        is_furnished = len(self._met.legs) >= FURNISHED_LEGS
        return is_furnished or self._now_s - self._met.leg_met_s < AMONG_LEGS_S

    @property
    def _now_s(self) -> float:
        return self._seen[0] if self._seen else 0.0

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
        self._met.drifts(drift)
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
        self._met.forget(self._ne_m, scan.time_s)
        self._folds.move_to(self._ne_m, self._yaw_rad)
        relative, yaw_rate_rad_s = self._relative(), self._turns_rad_s(scan.time_s)
        grids = (self._passed, self._proved) if self._is_among_legs else (self._passed,)
        readings = dict(scan.readings)
        new: list[tuple[Vector2, Found]] = []
        for beam in BEARING_FRD_RAD:
            unit, reading = self._units.get(beam), readings.get(beam)
            if unit is None or reading is None:
                continue
            line = self._line(unit, relative, yaw_rate_rad_s)
            is_on_it = (np.abs(line.aside_m) < ALIAS_ASIDE_M) & (line.along_m > 0)
            measured_m = line.along_m[is_on_it & self._met.is_measured]
            known_m = float(measured_m.min(initial=math.inf)) - unit.offset_m
            unfolded = readings[beam] = self._folds.unfolded(beam, reading, known_m)
            bearing_rad = self._yaw_rad + line.bearing_rad
            eye_ne_m = self._place(line.eye_frd_m)
            elsewhere_m = line.along_m[is_on_it & self._met.is_met_from_elsewhere(eye_ne_m)]
            free_m = _free_m(unfolded, unit, elsewhere_m - unit.offset_m)
            self._met.pass_through(scan.time_s, line, free_m)
            for grid in grids:
                grid.go(eye_ne_m, bearing_rad, free_m, scan.time_s)
            end = _end_m(unfolded, unit.offset_m)
            again = _met_again(unfolded, unit, line.along_m, is_on_it & self._met.is_sure)
            if again is not None:
                aside_m, there = line.aside_m[again], line.at_m(float(line.along_m[again]))
                self._met.meet_again(again, scan.time_s, float(aside_m), self._place(there))
            elif end is not None:
                end_m, sigma_m = end
                found = Found(_how_known(reading, unfolded), sigma_m, bearing_rad, eye_ne_m)
                new.append((self._place(line.at_m(end_m)), found))
        for grid in grids:
            grid.stand(self._ne_m, scan.time_s)
        self._met.let_go(scan.time_s)
        for place_ne_m, found in new:
            self._met.put(place_ne_m, scan.time_s, found)
        self._folds.look(scan.time_s, scan.readings, readings)
        return replace(scan, readings=readings)

    def _line(self, unit: RangeUnit, relative: Points, yaw_rate_rad_s: float) -> LineOfSight:
        """From where the drone was, and turned to, when the sensor measured."""
        age_s = unit.model.mean_age_s
        bearing_rad = unit.bearing_frd_rad - age_s * yaw_rate_rad_s
        cos_b, sin_b = math.cos(bearing_rad), math.sin(bearing_rad)
        forward_m_s, right_m_s = self._velocity_frd_m_s
        eye_frd_m = -age_s * forward_m_s, -age_s * right_m_s
        from_eye = relative - eye_frd_m
        return LineOfSight(
            eye_frd_m, bearing_rad, from_eye @ (cos_b, sin_b), from_eye @ (-sin_b, cos_b)
        )

    def _turns_rad_s(self, time_s: float) -> float:
        """By the headings now and when it was looked last."""
        last, self._seen = self._seen, (time_s, self._yaw_rad)
        if last is None or time_s <= last[0]:
            return 0.0
        return wrap_rad(self._yaw_rad - last[1]) / (time_s - last[0])

    def _place(self, at_frd_m: Vector2) -> Vector2:
        """In its own frame."""
        north_m, east_m = frd_to_ned(*at_frd_m, self._yaw_rad)
        return self._ne_m[0] + north_m, self._ne_m[1] + east_m

    def _relative(self) -> Points:
        """(n, 2), forward and right of the drone's centre."""
        return points_to_frd(self._met.places - self._ne_m, self._yaw_rad)


def _free_m(reading: RangeReading, unit: RangeUnit, elsewhere_m: Points) -> Vector2:
    """Nothing lies along the beam from here to there.

    A reading that may have folded back says nothing of what it may have met then, nor of what is
    nearer, if that is more than a guess; unless what it means was met from elsewhere, too, at one
    of `elsewhere_m`, (n,) from the sensor.
    """
    model = unit.model
    if reading.is_distance:
        alias_m = model.alias_m(reading.distance_m)
        end_m = reading.distance_m - 2 * math.sqrt(reading.variance_m2)
        is_known = (np.abs(elsewhere_m - reading.distance_m) <= KNOWN_M).any()
        from_m = 0.0 if alias_m is None or is_known else alias_m + unit.offset_m + SURELY_M
        return from_m, end_m + unit.offset_m
    if reading.state is RangeState.NOTHING:
        return 0.0, model.max_m
    return 0.0, 0.0


def _how_known(raw: RangeReading, unfolded: RangeReading) -> float:
    if unfolded.is_distance:
        return MEASURED
    return TOO_STRONG if raw.state is RangeState.TOO_NEAR else GUESSED


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
    is_exact = sigma_m < MAX_SIGMA_M and end_m < WITHIN_M
    return (end_m, 0.0 if is_exact else sigma_m) if end_m < KEPT_WITHIN_M else None

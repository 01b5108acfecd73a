"""Stores recent obstacles near the drone, as the beams detected them.

The points (`obstacle_points.py`) are stored in a frame of their own. Only odometry moves the drone
in it, and only the gyro turns the drone. A step of the estimate or a wrong wall association moves
the map, but not these points.

Readings that have folded back become TOO_NEAR (`fold_back.py`). Their range is inaccurate, so an
earlier measurement of the same obstacle replaces it.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from companion.core.arrays import Array, Mask
from companion.core.frames import Vector2, moved, points_to_frd, wrap_rad
from companion.core.messages import (
    BEARING_FRD_RAD,
    FIRST_LAG_S,
    Beam,
    RangeReading,
    RangeScan,
    RangeState,
    RangeUnit,
)
from companion.safety.control_laws import BODY_RADIUS_M, MAX_CLIMB_M_S
from companion.safety.drift import DRIFT_SIGMAS, NO_DRIFT, Drift
from companion.safety.fold_back import (
    ALIAS_ASIDE_M,
    ALIAS_M,
    KNOWN_M,
    ON_BEAM_M,
    FoldBackDetector,
    OnBeam,
)
from companion.safety.obstacle_points import (
    GUESSED,
    KEPT_WITHIN_M,
    MEASURED,
    OLD_S,
    SAME_M,
    TOO_STRONG,
    Detection,
    LineOfSight,
    ObstaclePoints,
)
from companion.safety.swept_space import NARROW, WIDE, Lane, SweptGrid, all_swept

WITHIN_M, MAX_SIGMA_M = 2.5, 0.06
"""A detection is exact within this distance of the drone's centre, m, and below this standard
deviation, m. It then replaces earlier points. Chosen."""
SURELY_M = 0.30
"""Margin beyond the alias of a reading, m. A point farther along the beam than alias plus margin is
not the folded obstacle, even with drift. Chosen: otherwise a person who has walked away would block
the way until the points expire."""
BEFORE_ALIAS_M, BEHIND_ALIAS_M = 0.03, 0.10
"""A confirmed reading proves nothing within these distances before and behind its alias, m. Chosen:
the noise of the alias, and a pole of 8 cm."""
AMONG_LEGS_S = 30.0
"""Time for which the drone counts as among legs after it detected one, s. Chosen: chairs stand in
groups."""
FURNISHED_LEGS = 4
"""From this number of legs on, the drone counts as among legs for the rest of the flight. Measured:
up to three ends of thin partitions in eleven flights without clutter; four and five legs in flights
with a clutter of 0.25."""
STAYED_S, DOUBT_SIGMAS = 15.0, 3.0
"""A gap is doubtful if its obstacle was not measured for this time, s, and if the drift in that
time, with so many sigmas, may be as large as the gap. Chosen: a drone that passes a doorway last
measures the jambs a few seconds before. At two sigmas the velocity limiter has no margin left."""
UNMEASURED_M = 0.55
"""Distance assumed for a new obstacle that is too near to be measured, from the drone's centre, m.
Chosen."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Inputs of the velocity limiter, body FRD, from the drone's centre."""

    points_frd_m: Array = field(default_factory=lambda: np.empty((0, 2)))
    """(n, 2), m, forward and right; for an inexact point, its nearest possible position."""
    velocity_frd_m_s: Vector2 = (0.0, 0.0)
    lag_s: float = FIRST_LAG_S
    """Time for which the drone keeps this velocity after a stop is commanded, s."""
    is_vague: Mask = field(default_factory=lambda: np.zeros(1, dtype=bool))
    """(n,), or (1,) for all: True for inexact points."""
    is_measured: Mask = field(default_factory=lambda: np.ones(1, dtype=bool))
    """(n,), or (1,) for all: True for points that were measured exactly."""
    drift_m: Array = field(default_factory=lambda: np.zeros(1))
    """(n,), or (1,) for all: sigma of the drone's drift since each point was detected, m."""
    recalled_frd_m: Array = field(default_factory=lambda: np.empty((0, 2)))
    """(r, 2), m: older obstacles, at their positions in the map."""
    others_frd_m: Array = field(default_factory=lambda: np.empty((0, 2)))
    """(d, 2), m: teammates to keep away from."""
    others_keep_off_m: Array = field(default_factory=lambda: np.empty(0))
    """(d,): distance to keep from each, between the centres, m."""
    lets_pass: bool = False
    """The drone is to be above a teammate that has the right of way."""
    may_climb: bool = True
    """Nothing is known near the drone that hangs too low for a climb above a teammate."""
    is_column_free: bool = True
    """No teammate flies near the column above the drone."""
    climb_limits_m_s: Vector2 = (-MAX_CLIMB_M_S, MAX_CLIMB_M_S)
    """Least and greatest down velocity that keeps teammates clear, m/s."""
    lane: Callable[[float], Lane] = all_swept
    """Returns the swept part of the path at a bearing, rad, FRD."""
    edge_frd: Vector2 = (1.0, 0.0)
    """Unit vector to the nearest edge of the fence."""
    edge_m: float = math.inf
    """Distance to it, m; negative outside."""
    is_among_legs: bool = False
    """A thin, isolated obstacle was detected recently."""
    legs: int = 0
    """Number of such obstacles detected in this flight."""
    is_gap_doubtful: bool = False
    """Among legs: the drift may have used up the gap to an obstacle since it was measured."""


NO_WALLS: Mapping[Beam, float] = {}
"""No wall of earlier flights is near."""


class ObstacleMemory:
    """Memory of the obstacles around the drone, in a frame of its own."""

    def __init__(self, units: Mapping[Beam, RangeUnit]) -> None:
        self._units = units
        self._points = ObstaclePoints()
        self._wide, self._narrow = SweptGrid(WIDE), SweptGrid(NARROW)
        self._fold_back = FoldBackDetector(units)
        self._ne_m: Vector2 = (0.0, 0.0)
        self._yaw_rad = 0.0
        self._velocity_frd_m_s: Vector2 = (0.0, 0.0)
        self._last_sweep: tuple[float, float] | None = None
        """Time, s, and heading, rad, of the last sweep."""

    def surroundings(self, lag_s: float) -> Surroundings:
        points_frd_m = self._points.nearest(self._ne_m, self._yaw_rad, self._wide)
        return Surroundings(
            points_frd_m,
            self._velocity_frd_m_s,
            lag_s,
            self._points.is_vague,
            self._points.is_measured,
            self._points.drift_m(self._now_s),
            lane=self._lane,
            is_among_legs=self._is_among_legs,
            legs=len(self._points.legs),
            is_gap_doubtful=self._is_among_legs and self._is_gap_doubtful(points_frd_m),
        )

    def _is_gap_doubtful(self, points_frd_m: Array) -> bool:
        # a surface extends around its point by the distance at which detections are one point
        gap_m = np.hypot(*points_frd_m.T) - BODY_RADIUS_M - SAME_M
        is_old = self._points.is_detected_before(self._now_s - STAYED_S)
        drifted_m = DOUBT_SIGMAS * self._points.drift_m(self._now_s)
        return bool((is_old & (drifted_m > gap_m)).any())

    def _lane(self, bearing_frd_rad: float) -> Lane:
        """Swept path at a bearing; older points near it have to be detected again."""
        bearing_rad = self._yaw_rad + bearing_frd_rad
        swept = self._narrow if self._is_among_legs else self._wide
        lane = swept.lane(self._ne_m, bearing_rad, self._now_s, self._points.drift)
        old = self._points.places[self._points.is_detected_before(self._now_s - OLD_S)]
        return lane.beside(*points_to_frd(old - self._ne_m, bearing_rad).T)

    @property
    def _is_among_legs(self) -> bool:
        is_furnished = len(self._points.legs) >= FURNISHED_LEGS
        return is_furnished or self._now_s - self._points.leg_detected_s < AMONG_LEGS_S

    @property
    def _now_s(self) -> float:
        return self._last_sweep[0] if self._last_sweep else 0.0

    def turn_to(self, heading_rad: float) -> None:
        """Set the heading by dead reckoning, which has no steps.

        The heading of odometry is a few hundredths of a second late. In a turn, that moves a point
        at one metre aside by centimetres.
        """
        self._yaw_rad = heading_rad

    def move_to(
        self, place_ne_m: Vector2, velocity_frd_m_s: Vector2 = (0.0, 0.0), drift: Drift = NO_DRIFT
    ) -> None:
        """Set position and velocity by dead reckoning, and its error model.

        The estimated pose is not used. Far ranges and wrong wall associations pull it by
        decimetres within seconds, whereas odometry wanders by centimetres.
        """
        self._ne_m, self._velocity_frd_m_s = place_ne_m, velocity_frd_m_s
        self._points.drift = drift

    def see(self, scan: RangeScan, walls_m: Mapping[Beam, float] = NO_WALLS) -> RangeScan:
        """Add a sweep; return it with the readings that have folded back as TOO_NEAR.

        `walls_m`: distance from a sensor to a wall of earlier flights along its beam.
        """
        self._points.forget(self._ne_m, scan.time_s)
        self._fold_back.move_to(scan.time_s, self._ne_m, self._yaw_rad)
        relative, yaw_rate_rad_s = self._relative(), self._turns_rad_s(scan.time_s)
        is_among_legs = self._is_among_legs
        readings = dict(scan.readings)
        new: list[tuple[Vector2, Detection]] = []
        is_measured, is_sure = self._points.is_measured, self._points.is_sure
        drift_m = self._points.drift_m(self._now_s)
        for beam in BEARING_FRD_RAD:
            unit, reading = self._units.get(beam), readings.get(beam)
            if unit is None or reading is None:
                continue
            line = self._line(unit, relative, yaw_rate_rad_s)
            is_on_it = (np.abs(line.aside_m) < ALIAS_ASIDE_M) & (line.along_m > 0)
            measured = np.flatnonzero(is_on_it & is_measured)
            wall_m = walls_m.get(beam, math.inf)
            points_m = line.along_m[measured] - unit.offset_m
            on_beam_m = ON_BEAM_M + DRIFT_SIGMAS * drift_m[measured]
            is_close = np.abs(line.aside_m[measured]) < on_beam_m
            known = OnBeam(points_m, points_m[is_close], wall_m)
            unfolded = readings[beam] = self._fold_back.unfolded(beam, reading, known)
            bearing_rad = self._yaw_rad + line.bearing_rad
            eye_ne_m = self._place(line.eye_frd_m)
            elsewhere = measured[self._points.is_detected_from_elsewhere(measured, eye_ne_m)]
            known_from_there_m = np.append(line.along_m[elsewhere] - unit.offset_m, wall_m)
            free_m = _free_m(unfolded, unit, known_from_there_m)
            self._points.free_strips(scan.time_s, line, free_m)
            self._wide.sweep(eye_ne_m, bearing_rad, free_m, scan.time_s)
            for proved_m in _proved_m(free_m, unfolded, unit) if is_among_legs else ():
                self._narrow.sweep(eye_ne_m, bearing_rad, proved_m, scan.time_s)
            end = _end_m(unfolded, unit.offset_m)
            again = _detected_again(unfolded, unit, line.along_m, is_on_it & is_sure)
            if again is not None:
                aside_m, there = line.aside_m[again], line.at_m(float(line.along_m[again]))
                self._points.confirm(again, scan.time_s, float(aside_m), self._place(there))
            elif end is not None:
                end_m, sigma_m = end
                found = Detection(_how_known(reading, unfolded), sigma_m, bearing_rad, eye_ne_m)
                new.append((self._place(line.at_m(end_m)), found))
        for grid in (self._wide, self._narrow) if is_among_legs else (self._wide,):
            grid.free_hull(self._ne_m, scan.time_s)
        self._points.delete_freed(scan.time_s)
        for place_ne_m, found in new:
            self._points.add(place_ne_m, scan.time_s, found)
        self._fold_back.record_free(scan.time_s, scan.readings, readings)
        return replace(scan, readings=readings)

    def _line(self, unit: RangeUnit, relative: Array, yaw_rate_rad_s: float) -> LineOfSight:
        """Line of sight from the drone's position and heading when the sensor measured."""
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
        """Yaw rate since the last sweep, rad/s."""
        last, self._last_sweep = self._last_sweep, (time_s, self._yaw_rad)
        if last is None or time_s <= last[0]:
            return 0.0
        return wrap_rad(self._yaw_rad - last[1]) / (time_s - last[0])

    def _place(self, at_frd_m: Vector2) -> Vector2:
        """Convert body FRD to the frame of the points, m."""
        return moved(self._ne_m, at_frd_m, self._yaw_rad)

    def _relative(self) -> Array:
        """Points (n, 2), m, forward and right of the drone's centre."""
        return points_to_frd(self._points.places - self._ne_m, self._yaw_rad)


def _free_m(reading: RangeReading, unit: RangeUnit, elsewhere_m: Array) -> Vector2:
    """Return start and end of the free part of the beam, from the drone's centre, m.

    A reading that may have folded back frees nothing up to its alias plus `SURELY_M`, except of
    guessed points. It frees the whole beam if a point measured from elsewhere, or a wall of earlier
    flights, confirms it. They are at `elsewhere_m` (n,) from the sensor.
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


def _proved_m(free_m: Vector2, reading: RangeReading, unit: RangeUnit) -> tuple[Vector2, ...]:
    """Return the parts of a beam's free part that hold even if the reading has folded back, m.

    A pole at the alias of a confirmed reading gives the same reading by chance; a pole at any other
    distance gives another. So only the place of the alias is not proved.
    """
    alias_m = unit.model.alias_m(reading.distance_m) if reading.is_distance else None
    from_m, to_m = free_m
    if alias_m is None or from_m >= alias_m + unit.offset_m + BEHIND_ALIAS_M:
        return (free_m,)
    at_m = alias_m + unit.offset_m
    return (from_m, min(at_m - BEFORE_ALIAS_M, to_m)), (at_m + BEHIND_ALIAS_M, to_m)


def _how_known(raw: RangeReading, unfolded: RangeReading) -> float:
    if unfolded.is_distance:
        return MEASURED
    return TOO_STRONG if raw.state is RangeState.TOO_NEAR else GUESSED


def _detected_again(
    reading: RangeReading, unit: RangeUnit, along_m: Array, is_on_it: Mask
) -> int | None:
    """Index of the point (n,) that a TOO_NEAR reading detects again; None if there is none.

    The signal fits two distances: one near the sensor's minimum and one nearer than the peak.
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
    """Assumed distance from the sensor to an obstacle that is too near, m."""
    return UNMEASURED_M - offset_m if math.isnan(reading.distance_m) else reading.distance_m


def _end_m(reading: RangeReading, offset_m: float) -> tuple[float, float] | None:
    """Distance of the obstacle from the drone's centre and its sigma, m; sigma 0 if exact."""
    if reading.state is RangeState.TOO_NEAR:
        return _guess_m(reading, offset_m) + offset_m, 0.0
    if not reading.is_distance:
        return None
    sigma_m, end_m = math.sqrt(reading.variance_m2), reading.distance_m + offset_m
    is_exact = sigma_m < MAX_SIGMA_M and end_m < WITHIN_M
    return (end_m, 0.0 if is_exact else sigma_m) if end_m < KEPT_WITHIN_M else None

"""Estimates position, odometry scale and wall offsets together.

A Kalman filter over

    x = (north, east, scale error, wander north, wander east, d_1, d_2, ...)

Wall i has the direction α_i of its normal from the heading filter, an anchor a_i at its first hits,
and its offset d_i: the line {p : (p - a_i)·n_i = d_i}. A change of α_i turns the wall about its
anchor. Odometry moves the position by (1 + scale)·displacement, so ranges to a wall ahead measure
the scale. It also moves the position by the decay of the wander (`odometry_model.py`). A range r
along bearing β from position p meets wall i where

    r = (d_i - (p - a_i)·n_i) / cos(β - α_i)
"""

import math
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import Vector2, Vector3, wrap_rad
from companion.core.messages import RangeModel, RangeUnit
from companion.core.values import value
from companion.estimation.filters.heading_filter import HeadingFilter
from companion.estimation.filters.wall_runs import MAX_INCIDENCE_RAD, Line
from companion.estimation.smoothing.odometry_model import WANDER_S, OdometryModel

_NORTH, _EAST, _SCALE, _WANDER_NORTH, _WANDER_EAST = range(5)
"""Indices of the first states in x."""
WALLS = 5
"""Index of the first wall in x."""
MAX_DIRECTION_SIGMA_M = 0.12
"""Only readings with at most this sigma determine wall directions, m. Chosen."""


@dataclass(slots=True)
class Wall:
    """Anchor of a wall, and the interval along its line that has hits.

    Along is measured from the anchor in the direction t = (-sin, cos)(normal), metres.
    """

    index: int
    anchor_ne_m: Vector2
    low_m: float
    high_m: float
    measured_s: float = -math.inf
    """Time of the last range that corrected the position by it, s; -inf before the first."""

    def extend(self, along_m: float) -> None:
        self.low_m = min(self.low_m, along_m)
        self.high_m = max(self.high_m, along_m)

    def reaches(self, along_m: float, margin_m: float) -> bool:
        return self.low_m - margin_m < along_m < self.high_m + margin_m


@value
class _Match:
    wall: Wall
    along_m: float
    innovation_m: float
    gradient: Vector3
    """Derivatives of the range by north, east and the wall's offset."""
    spread_m2: float
    """Variance of the innovation, gᵀ P g + r."""
    is_informative: bool
    """False near the end of the sensor's range, where long readings are missing."""


class LineSlam:
    """The joint filter; angles are local NED bearings in radians."""

    GATE_SIGMAS = 3.5
    """Ranges beyond this many sigmas of a wall's innovation do not match it. Chosen."""
    EXTENT_MARGIN_M = 1.2
    """A hit this far beyond the known end of a wall may still belong to it, m. Chosen."""
    END_SIGMAS = 2.0
    """Predicted ranges within this many sigmas of the maximum range are not used. Chosen."""
    HALF_WEIGHT_M = 0.25
    """A range with this innovation has half the weight, a larger one less, m. Chosen: where the
    position is uncertain, one range on an unmapped obstacle must not shift it."""
    SAME_NORMAL_RAD = math.radians(12)
    """Lines whose normals differ by more are not the same wall, rad. Chosen."""

    def __init__(self, heading: HeadingFilter, odometry: OdometryModel) -> None:
        self._heading = heading
        self._odometry = odometry
        self._x = [0.0] * WALLS
        self._p: Array = np.diag([0.0, 0.0, odometry.scale_sigma**2, 0.0, 0.0])
        self._f: Array = np.eye(WALLS)
        self.walls: list[Wall] = []

    @property
    def position_ne_m(self) -> Vector2:
        return self._x[_NORTH], self._x[_EAST]

    @property
    def position_sigma_m(self) -> float:
        return math.sqrt(max(self._p.item(_NORTH, _NORTH), self._p.item(_EAST, _EAST)))

    @property
    def scale_error(self) -> float:
        return self._x[_SCALE]

    def restart(self, state: Array, covariance: Array, walls: list[Wall]) -> None:
        """Restart from the state x (n,) of the module's docstring and its covariance (n, n)."""
        self._x, self._p, self._f = state.tolist(), covariance, np.eye(len(state))
        self.walls = walls

    def line(self, wall: Wall) -> tuple[float, float]:
        """(normal_rad, offset_m) of a wall as {p : p·n = offset}."""
        normal_rad = self._heading.normal_rad(wall.index)
        north, east = wall.anchor_ne_m
        offset_m = north * math.cos(normal_rad) + east * math.sin(normal_rad)
        return normal_rad, offset_m + self._x[WALLS + wall.index]

    @property
    def offsets_covariance_m2(self) -> Array:
        """(w, w): covariance of the walls' offsets from their anchors, in their order."""
        return self._p[WALLS:, WALLS:].copy()

    def offset_sigma_m(self, wall: Wall) -> float:
        at = WALLS + wall.index
        return math.sqrt(self._p.item(at, at))

    def lines_and_reach(self) -> tuple[Array, Array]:
        """Lines (w, 2) as by `line`, and intervals (w, 2) along them with hits; local NED, rad, m.

        Along is measured from the foot of the origin, in the direction (-sin, cos)(normal).
        """
        lines = np.array([self.line(wall) for wall in self.walls]).reshape(-1, 2)
        anchors_ne_m = np.array([wall.anchor_ne_m for wall in self.walls]).reshape(-1, 2)
        ends_m = np.array([(wall.low_m, wall.high_m) for wall in self.walls]).reshape(-1, 2)
        tangents = np.column_stack([-np.sin(lines[:, 0]), np.cos(lines[:, 0])])
        return lines, ends_m + (anchors_ne_m * tangents).sum(axis=1)[:, None]

    def move(self, displacement_ne_m: Vector2, dt_s: float) -> None:
        """Predict by the odometry's displacement in local NED, its scale not yet applied."""
        scale = 1 + self._x[_SCALE]
        north, east = displacement_ne_m
        kept = math.exp(-dt_s / WANDER_S)
        x, f = self._x, self._f
        x[_NORTH] += scale * north + (1 - kept) * x[_WANDER_NORTH]
        x[_EAST] += scale * east + (1 - kept) * x[_WANDER_EAST]
        x[_WANDER_NORTH] *= kept
        x[_WANDER_EAST] *= kept
        # F = I except for the columns of scale and wander; P' = F P F' + Q
        f[_NORTH, _SCALE], f[_EAST, _SCALE] = north, east
        f[_NORTH, _WANDER_NORTH] = f[_EAST, _WANDER_EAST] = 1 - kept
        f[_WANDER_NORTH, _WANDER_NORTH] = f[_WANDER_EAST, _WANDER_EAST] = kept
        self._p = p = f.dot(self._p).dot(f.T)
        walk = self._odometry.step_variance_m2_per_s * dt_s
        wanders = self._odometry.wander_m**2 * (1 - kept**2)
        yaw_sigma_rad = self._heading.yaw_sigma_rad
        p[_NORTH, _NORTH] += walk + wanders + (east * yaw_sigma_rad) ** 2
        p[_EAST, _EAST] += walk + wanders + (north * yaw_sigma_rad) ** 2
        for place, wander in ((_NORTH, _WANDER_NORTH), (_EAST, _WANDER_EAST)):
            p[wander, wander] += wanders
            p[place, wander] -= wanders
            p[wander, place] -= wanders

    def correct_by_range(
        self, centre_ne_m: Vector2, bearing_rad: float, range_m: float, unit: RangeUnit
    ) -> int | None:
        """Correct by one range from the drone's centre at `centre_ne_m`; returns its wall's index.

        None if no wall matches, or if the best match is too near the end of the sensor's range to
        carry information. Then the range must not correct another wall.
        """
        best: tuple[float, _Match] | None = None
        for index in self._heading.facing(bearing_rad, MAX_INCIDENCE_RAD):
            match = self._match(self.walls[index], centre_ne_m, bearing_rad, range_m, unit)
            if match is None:
                continue
            misfit = abs(match.innovation_m) / math.sqrt(match.spread_m2)
            if misfit < self.GATE_SIGMAS and (best is None or misfit < best[0]):
                best = misfit, match
        if best is None or not best[1].is_informative:
            return None
        self._correct(best[1])
        best[1].wall.extend(best[1].along_m)
        return best[1].wall.index

    def _match(
        self,
        wall: Wall,
        centre_ne_m: Vector2,
        bearing_rad: float,
        range_m: float,
        unit: RangeUnit,
    ) -> _Match | None:
        """Innovation of the range for a wall that faces it; None if the beam cannot have met it.

        The noise is taken at the predicted distance, not at the measured one. Otherwise short
        readings would count for more than long ones.
        """
        normal_rad = self._heading.normal_rad(wall.index)
        incidence_rad = bearing_rad - normal_rad
        cos_incidence = math.cos(incidence_rad)
        cos_n, sin_n = math.cos(normal_rad), math.sin(normal_rad)
        north, east = centre_ne_m[0] - wall.anchor_ne_m[0], centre_ne_m[1] - wall.anchor_ne_m[1]
        along_m = cos_n * east - sin_n * north + range_m * math.sin(incidence_rad)
        distance_m = self._x[WALLS + wall.index] - north * cos_n - east * sin_n
        if distance_m <= 0 or not wall.reaches(along_m, self.EXTENT_MARGIN_M):
            return None
        predicted_m = distance_m / cos_incidence
        model, from_unit_m = unit.model, predicted_m - unit.offset_m
        sigma_m = model.sigma_m(max(from_unit_m, model.min_m))
        is_informative = from_unit_m < model.max_m - self.END_SIGMAS * sigma_m
        # d r / d(bearing - normal) = r·tan; turning the wall about its anchor adds its lever.
        lever_m = math.hypot(predicted_m * math.tan(incidence_rad), along_m / cos_incidence)
        gradient = -cos_n / cos_incidence, -sin_n / cos_incidence, 1 / cos_incidence
        angle_sigma_rad = self._heading.relative_sigma_rad(wall.index)
        spread_m2 = self._variance(WALLS + wall.index, gradient)
        spread_m2 += sigma_m**2 + (lever_m * angle_sigma_rad) ** 2
        return _Match(wall, along_m, range_m - predicted_m, gradient, spread_m2, is_informative)

    def _variance(self, at: int, gradient: Vector3) -> float:
        """gᵀ P g of a gradient that is zero except for north, east and the offset at index `at`."""
        north, east, offset = gradient
        p = self._p.item
        squares = north**2 * p(_NORTH, _NORTH) + east**2 * p(_EAST, _EAST) + offset**2 * p(at, at)
        mixed = north * east * p(_NORTH, _EAST)
        mixed += offset * (north * p(_NORTH, at) + east * p(_EAST, at))
        return squares + 2 * mixed

    def _correct(self, match: _Match) -> None:
        """Scalar Kalman update in Joseph form, multiplied out: P - k·(Ph)ᵀ - Ph·kᵀ + s·k·kᵀ."""
        north, east, offset = match.gradient
        p = self._p
        ph = north * p[_NORTH] + east * p[_EAST] + offset * p[WALLS + match.wall.index]
        spread_m2 = match.spread_m2 * (1 + (match.innovation_m / self.HALF_WEIGHT_M) ** 2)
        gain = ph / spread_m2
        self._x = [x + k * match.innovation_m for x, k in zip(self._x, gain.tolist(), strict=True)]
        reduction = gain[:, None] * ph
        p += spread_m2 * gain[:, None] * gain - reduction - reduction.T

    def find(self, line: Line) -> Wall | None:
        """The known wall with the same direction whose line passes through the run's centre."""
        best: tuple[float, Wall] | None = None
        for wall in self.walls:
            normal_rad = self._heading.normal_rad(wall.index)
            if abs(wrap_rad(line.normal_rad - normal_rad)) > self.SAME_NORMAL_RAD:
                continue
            north = line.centre[0] - wall.anchor_ne_m[0]
            east = line.centre[1] - wall.anchor_ne_m[1]
            cos_n, sin_n = math.cos(normal_rad), math.sin(normal_rad)
            along_m = cos_n * east - sin_n * north
            at = WALLS + wall.index
            lever = along_m * self._heading.relative_sigma_rad(wall.index)
            spread = self._variance(at, (cos_n, sin_n, -1.0)) + line.offset_sigma_m**2 + lever**2
            across_m = north * cos_n + east * sin_n - self._x[at]
            misfit = abs(across_m) / math.sqrt(spread)
            reached = wall.reaches(along_m, self.EXTENT_MARGIN_M + line.length_m / 2)
            if reached and misfit < self.GATE_SIGMAS and (best is None or misfit < best[0]):
                best = misfit, wall
        return best[1] if best else None

    def add(self, line: Line, index: int) -> Wall:
        """Add a wall through the run's centre, with the sigmas of position and run."""
        normal_rad = self._heading.normal_rad(index)
        half_m = line.length_m / 2
        wall = Wall(index, line.centre, -half_m, half_m)
        size = len(self._x)
        grown = np.zeros((size + 1, size))
        grown[:size, :size] = np.eye(size)
        grown[size, [_NORTH, _EAST]] = math.cos(normal_rad), math.sin(normal_rad)
        self._p = grown @ self._p @ grown.T
        self._p[size, size] += line.offset_sigma_m**2
        self._x.append(0.0)
        self._f = np.eye(size + 1)
        self.walls.append(wall)
        return wall


def max_direction_range_m(sensor: RangeModel) -> float:
    """Longest range that determines wall directions, m: low sigma, not near the end of range."""
    distance_m = sensor.max_m - LineSlam.END_SIGMAS * sensor.sigma_m(sensor.max_m)
    while sensor.sigma_m(distance_m) > MAX_DIRECTION_SIGMA_M:
        distance_m -= 0.1
    return distance_m

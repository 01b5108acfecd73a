"""The mapped walls with their joint covariance."""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.core.arrays import Array, Mask
from companion.core.frames import Vector2

OPPOSITE_RAD = math.radians(10)
"""Walls are opposite within this angle, rad. Chosen."""

ON_WALL_M = 0.2
"""A place at most this far from a wall's line lies on it, m: two cells of the map."""
BEYOND_END_M = 1.2
"""A place at most this far beyond the known end of a wall may still lie on it, m: as for the ranges
of `position_filter.py`."""


@dataclass(frozen=True, slots=True)
class KnownWalls:
    """Lines {p : p·n = offset}, normals away from the drone; local NED, metres."""

    normals: Array
    """(w, 2): unit normals."""
    offsets_m: Array
    """(w,): distances from the origin."""
    reach_m: Array
    """(w, 2): interval along (-sin, cos)(normal)."""
    covariance_m2: Array
    """(w, w): covariance of the walls' offsets at their middles."""
    measured_s: Array
    """(w,): time of the last range that met the wall, s; -inf without one."""

    @classmethod
    def none(cls) -> "KnownWalls":
        """An empty set of walls."""
        return cls(np.empty((0, 2)), np.empty(0), np.empty((0, 2)), np.empty((0, 0)), np.empty(0))

    @property
    def tangents(self) -> Array:
        """(w, 2): unit vectors along the walls."""
        return np.column_stack([-self.normals[:, 1], self.normals[:, 0]])

    @property
    def lengths_m(self) -> Array:
        """(w,): lengths of the walls."""
        lengths_m: Array = np.ptp(self.reach_m, axis=1)
        return lengths_m

    @property
    def sigmas_m(self) -> Array:
        """(w,): sigmas of the walls' offsets."""
        sigmas_m: Array = np.sqrt(np.diag(self.covariance_m2))
        return sigmas_m

    def with_measured(self, sigmas_m: Array) -> "KnownWalls":
        """These walls after an independent measurement of each offset, with sigmas (w,), m.

        Infinite: not measured. Only the covariance changes, as in a Kalman update.
        """
        measured = np.flatnonzero(np.isfinite(sigmas_m))
        if not len(measured):
            return self
        of_measured = self.covariance_m2[:, measured]
        innovation_m2 = of_measured[measured] + np.diag(sigmas_m[measured] ** 2)
        gained_m2 = of_measured @ np.linalg.solve(innovation_m2, of_measured.T)
        return replace(self, covariance_m2=self.covariance_m2 - gained_m2)

    def distances_m(self, places_ne_m: Array) -> Array:
        """(p, w): perpendicular distances from positions (p, 2) to the walls; < 0 from behind."""
        distance_m: Array = self.offsets_m - places_ne_m @ self.normals.T
        return distance_m

    def has_on_it(self, places_ne_m: Array) -> Mask:
        """(p, w): True where a place (p, 2) lies on a wall, or not far beyond its end."""
        return beside(places_ne_m, self.normals, self.offsets_m, self.reach_m, ON_WALL_M)

    def measured_at_s(self, places_ne_m: Array) -> Array:
        """(p,): the last time at which the wall of each place (p, 2) was measured; -inf without."""
        measured_s = np.where(self.has_on_it(places_ne_m), self.measured_s, -np.inf)
        latest_s: Array = measured_s.max(axis=1, initial=-np.inf)
        return latest_s

    def foot_ne_m(self, wall: int, place_ne_m: Vector2) -> Vector2:
        """Foot of the perpendicular from a position to the wall."""
        north, east = self.normals[wall].tolist()
        distance_m = float(self.offsets_m[wall]) - place_ne_m[0] * north - place_ne_m[1] * east
        return place_ne_m[0] + distance_m * north, place_ne_m[1] + distance_m * east

    def gap_sigmas_m(self) -> Array:
        """(w, w): sigma of the distance between walls that face each other; 0 for all others."""
        variance = np.diag(self.covariance_m2)
        gap_m2 = variance + variance[:, None] + 2 * self.covariance_m2
        is_facing = self.normals @ self.normals.T < -math.cos(OPPOSITE_RAD)
        return np.where(is_facing, np.sqrt(np.maximum(gap_m2, 0.0)), 0.0)


def beside(
    places_ne_m: Array, normals: Array, offsets_m: Array, reach_m: Array, within_m: float
) -> Mask:
    """(p, w): True where a place (p, 2) is near a wall's line, and not far beyond the wall's end.

    The walls are given as in `KnownWalls`.
    """
    along_m = places_ne_m @ np.column_stack([-normals[:, 1], normals[:, 0]]).T
    is_beside: Mask = np.abs(offsets_m - places_ne_m @ normals.T) <= within_m
    is_beside &= along_m >= reach_m[:, 0] - BEYOND_END_M
    is_beside &= along_m <= reach_m[:, 1] + BEYOND_END_M
    return is_beside

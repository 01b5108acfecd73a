"""The mapped walls, and how well they are known together."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import Vector2

Array = NDArray[np.float64]
OPPOSITE_RAD = math.radians(10)
"""Two walls are opposite within this."""


@dataclass(frozen=True, slots=True)
class KnownWalls:
    """Lines {p : p·n = offset}, the normals away from where they were seen; local NED, metres."""

    normals: Array
    """(w, 2)."""
    offsets_m: Array
    """(w,)."""
    reach_m: Array
    """(w, 2): from where to where along (-sin, cos)(normal)."""
    covariance_m2: Array
    """(w, w): of the walls' distances from the origin, at their middles."""

    @classmethod
    def none(cls) -> "KnownWalls":
        """Before any was mapped."""
        return cls(np.empty((0, 2)), np.empty(0), np.empty((0, 2)), np.empty((0, 0)))

    @property
    def tangents(self) -> Array:
        """(w, 2)."""
        return np.column_stack([-self.normals[:, 1], self.normals[:, 0]])

    @property
    def lengths_m(self) -> Array:
        """(w,)."""
        lengths_m: Array = np.ptp(self.reach_m, axis=1)
        return lengths_m

    @property
    def sigmas_m(self) -> Array:
        """(w,): of their distances from the origin."""
        sigmas_m: Array = np.sqrt(np.diag(self.covariance_m2))
        return sigmas_m

    def distances_m(self, places_ne_m: Array) -> Array:
        """(p, w): how far it is from places (p, 2) straight to the walls; < 0 from behind."""
        away_m: Array = self.offsets_m - places_ne_m @ self.normals.T
        return away_m

    def foot_ne_m(self, wall: int, place_ne_m: Vector2) -> Vector2:
        """Where a beam straight to the wall meets it."""
        north, east = self.normals[wall].tolist()
        away_m = float(self.offsets_m[wall]) - place_ne_m[0] * north - place_ne_m[1] * east
        return place_ne_m[0] + away_m * north, place_ne_m[1] + away_m * east

    def gap_sigmas_m(self) -> Array:
        """(w, w): of the distance between walls that face one another; 0 for all others."""
        variance = np.diag(self.covariance_m2)
        gap_m2 = variance + variance[:, None] + 2 * self.covariance_m2
        faces = self.normals @ self.normals.T < -math.cos(OPPOSITE_RAD)
        return np.where(faces, np.sqrt(np.maximum(gap_m2, 0.0)), 0.0)

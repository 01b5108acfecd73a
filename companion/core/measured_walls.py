"""The walls that ranges of this flight have met, each with the time of the last one."""

from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array

ON_WALL_M = 0.2
"""A place at most this far from a wall's line lies on it, m: two cells of the map."""
BEYOND_END_M = 1.2
"""A place at most this far beyond the known end of a wall may still lie on it, m: as for the ranges
of `position_filter.py`."""


@dataclass(frozen=True, slots=True)
class MeasuredWalls:
    """Lines {p : p·n = offset}; local NED, m, s."""

    normals: Array
    """(w, 2): unit normals."""
    offsets_m: Array
    """(w,): distances from the origin."""
    reach_m: Array
    """(w, 2): interval along (-sin, cos)(normal)."""
    measured_s: Array
    """(w,): time of the last range; -inf before the first."""

    @classmethod
    def none(cls) -> "MeasuredWalls":
        """An empty set of walls."""
        return cls(np.empty((0, 2)), np.empty(0), np.empty((0, 2)), np.empty(0))

    def measured_at_s(self, places_ne_m: Array) -> Array:
        """(p,): the last time at which the wall of each place (p, 2) was measured; -inf without."""
        tangents = np.column_stack([-self.normals[:, 1], self.normals[:, 0]])
        along_m = places_ne_m @ tangents.T
        is_on = np.abs(places_ne_m @ self.normals.T - self.offsets_m) <= ON_WALL_M
        is_on &= along_m >= self.reach_m[:, 0] - BEYOND_END_M
        is_on &= along_m <= self.reach_m[:, 1] + BEYOND_END_M
        latest_s: Array = np.where(is_on, self.measured_s, -np.inf).max(axis=1, initial=-np.inf)
        return latest_s

"""Finds the nearest of thousands of walls for thousands of points, without a table of all pairs."""

import math
from itertools import chain

import numpy as np
from scipy.spatial import cKDTree

from companion.core.arrays import Array, Indices
from sitl.world.plan import spread

ROUNDING_M = 1e-9
"""Tolerance for rounding in the reach of a wall sample, m. Chosen."""
SAMPLES_AT_FIRST = 8
"""Wall samples queried for all points at once; few points have more within reach. Chosen."""


class NearestWall:
    """Returns the same bits as the minimum over all walls.

    A sample of the nearest wall is at most half a spacing farther from a point than the wall. All
    walls with a sample within the nearest sample's distance plus half a spacing are therefore
    checked.
    """

    def __init__(self, walls: Array) -> None:
        self._start, self._along = walls[:, 0], walls[:, 1] - walls[:, 0]
        self._length2 = np.maximum((self._along**2).sum(axis=1), 1e-12)
        points, self._wall_of = spread(walls)
        self._tree = cKDTree(points)
        count = np.bincount(self._wall_of, minlength=len(walls))
        spacing_m = np.linalg.norm(self._along, axis=1) / count
        self._reach_m = float(spacing_m.max()) / 2 + ROUNDING_M

    def query(self, points: Array, within_m: float = math.inf) -> tuple[Array, Array]:
        """Distance (n,) and closest point (n, 2) on any wall, for points (n, 2), m.

        A distance above `within_m` may be infinite. Then the closest point is NaN.
        """
        distance_m, foot = np.full(len(points), math.inf), np.full((len(points), 2), math.nan)
        if not len(points):
            return distance_m, foot
        bound_m = within_m + 2 * self._reach_m
        sample_m, sample = self._tree.query(points, SAMPLES_AT_FIRST, distance_upper_bound=bound_m)
        reach_m = sample_m[:, 0] + self._reach_m
        is_near = np.isfinite(sample_m) & (sample_m <= reach_m[:, None])
        row, column = np.nonzero(is_near)
        crowded = np.flatnonzero(is_near[:, -1])
        near = self._tree.query_ball_point(points[crowded], reach_m[crowded])
        rows = [row, np.repeat(crowded, [len(samples) for samples in near])]
        samples = sample[row, column], np.fromiter(chain.from_iterable(near), dtype=np.int64)
        pairs = np.column_stack([np.concatenate(rows), self._wall_of[np.concatenate(samples)]])
        found = np.unique(row)
        distance_m[found], foot[found] = self._best(points, pairs)
        return distance_m, foot

    def _best(self, points: Array, pairs: Indices) -> tuple[Array, Array]:
        """The nearest wall of each point among pairs (k, 2); the first one if two are as near."""
        row, wall = pairs.T
        foot = self._feet(points[row], wall)
        distance = np.linalg.norm(points[row] - foot, axis=1)
        order = np.lexsort((wall, distance, row))
        first = order[np.unique(row[order], return_index=True)[1]]
        return distance[first], foot[first]

    def _feet(self, points: Array, wall: Indices) -> Array:
        """The closest point (n, 2) on the given wall of each point."""
        start, along = self._start[wall], self._along[wall]
        share = ((points - start) * along).sum(axis=1) / self._length2[wall]
        feet: Array = start + np.clip(share, 0, 1)[:, None] * along
        return feet

"""Records the space that beams have swept recently, in cells finer than furniture.

The points of `obstacle_memory.py` are the detected obstacles. An obstacle may also stand where no
beam has passed: the nose swings during flight, and a beam easily misses a leg of 3 cm. The grid
gives the distance that the drone can fly until its body touches an unswept cell:

            ░░░░░ ░░░░░      ░ swept; a gap between two beams is not
    drone ► ░░░░░ ░░░░░░░░
            ░░░░░░░░░░░
            ◄─► clear

It also gives the sector on either side of the path in which such gaps remain. The nose turns there
next.

The cells lie in the frame of `obstacle_memory.py`, which only odometry moves. The grid wraps
around. Its opposite side is so far away that its times have expired when the drone arrives.

There are two grids. In the wide grid, a beam sweeps a cell if it passes near the cell's middle.
Beams 5 cm apart leave no gap, although a leg may stand between them. In the narrow grid, a beam
sweeps only cells in whose middle no leg can stand undetected. That is proof to half a cell. It
takes longer, and is used among legs.
"""

import math
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2
from companion.safety.control_laws import BODY_RADIUS_M
from companion.safety.drift import DRIFT_SIGMAS, NO_DRIFT, Drift

LATELY_S = 30.0
"""Time for which a swept cell stays free, s. Chosen: odometry drifts by less than a hand's width.
With 6 s a flight takes a quarter longer, because the space swept on one leg expires before the
next."""
TO_M = 3.0
"""Range of the path ahead, m. Chosen: farther away, two readings of a swinging beam are more than a
wide cell apart."""
LEG_M = 0.03
"""Diameter of the thinnest obstacle, m. A beam that passes its middle within half of that detects
it. Chosen."""
EYE_M = 0.1
"""Distance from the drone's centre to the front sensor, m. Chosen."""
NEXT_M = 1.5
"""The nose turns to gaps that the body reaches within this distance, m. Chosen: on a straight path
with legs, 1.5 and 2.2 m leave equally few legs undetected. With 1 m the drone is slower and detects
fewer."""
BESIDE_M = 0.6
"""Obstacles within this distance of the path's middle are one side of a passage, m. Chosen: the
drone passes a doorway of 1.2 m in its middle, 0.4 m from either jamb."""


_ACROSS_LEG_M = np.array([-LEG_M / 2, 0.0, LEG_M / 2])
"""Offsets from a beam at which it sweeps cells of the wide grid, m."""


@dataclass(frozen=True, slots=True)
class GridSpec:
    """Geometry of a grid, and the rule by which a beam sweeps its cells."""

    cell_m: float
    """Side of a cell, m."""
    cells: int
    """Number of cells along each side of the grid, a power of two."""
    to_m: float
    """Length of the path ahead that is evaluated, m."""
    reach_m: float
    """Radius around the drone's centre that covers the body and a cell, m."""
    beside_m: float
    """Width of the strip on either side of the path that may have drifted into it, m; 0 where the
    drone may crawl into unswept space anyway."""
    is_proof: bool
    """True: a beam sweeps only cells in whose middle no leg can stand undetected.

    False: it sweeps all cells that a beam of a leg's width touches.
    """

    @property
    def hull_m(self) -> float:
        """Radius of the body plus two cells, m; free of obstacles, since the drone is there."""
        return BODY_RADIUS_M + 2 * self.cell_m

    @property
    def wrap(self) -> int:
        """Bits of a cell's number that remain when the grid wraps around."""
        return self.cells - 1

    @property
    def step_m(self) -> float:
        """Step between two samples along or across the path, m; less than a cell."""
        return 0.5 * self.cell_m


WIDE = GridSpec(cell_m=0.05, cells=256, to_m=TO_M, reach_m=0.24, beside_m=0.0, is_proof=False)
"""Grid for flight in the open. Chosen."""
NARROW = GridSpec(cell_m=0.0125, cells=512, to_m=1.8, reach_m=0.2125, beside_m=0.2, is_proof=True)
"""Grid among legs. Chosen: `to_m` is the stopping distance from 1 m/s plus half a second,
`beside_m` is two sigmas of the drift over `LATELY_S`."""


@dataclass(frozen=True, slots=True)
class Lane:
    """A straight path ahead of the drone, as wide as the drone."""

    clear_m: float = TO_M
    """Distance that the drone can fly until it touches an unswept cell, up to `TO_M`, m."""
    left_rad: float = 0.0
    right_rad: float = 0.0
    """Angles off the path, to either side, up to which near cells are still unswept."""

    def beside(self, along_m: Array, aside_m: Array) -> "Lane":
        """Return the path with its sector extended to obstacles near it.

        The obstacles (n,) lie `along_m` on the path and `aside_m` to the right of it.
        """
        is_near = (along_m > WIDE.hull_m) & (along_m < NEXT_M) & (np.abs(aside_m) < BESIDE_M)
        off_rad = np.arctan2(aside_m[is_near], along_m[is_near] - EYE_M)
        return Lane(
            self.clear_m,
            max(self.left_rad, float(-off_rad.min(initial=0.0))),
            max(self.right_rad, float(off_rad.max(initial=0.0))),
        )


def all_swept(bearing_frd_rad: float) -> Lane:
    """Return a clear path, for callers without a record of beams."""
    return Lane()


class SweptGrid:
    """Grid with the time at which a beam last swept each cell."""

    def __init__(self, spec: GridSpec = WIDE) -> None:
        self._spec = spec
        self._when_s = np.full((spec.cells, spec.cells), -math.inf)
        self._hull = _disc(spec)
        self._along_m = np.arange(0.0, spec.to_m, spec.step_m)
        self._offsets_m = np.arange(-LEG_M / 2, LEG_M / 2, spec.step_m)
        """Samples across the width of a leg, m."""
        self._samples = _PathSamples.of(spec)

    def free_hull(self, place_ne_m: Vector2, time_s: float) -> None:
        """Mark the cells that the drone's hull covers as free."""
        self._when_s[self._cells(self._hull + place_ne_m)] = time_s

    def sweep(self, eye_ne_m: Vector2, bearing_rad: float, free_m: Vector2, time_s: float) -> None:
        """Mark the cells that a beam swept from `free_m[0]` to `free_m[1]`, m from its origin."""
        from_m, to_m = free_m[0], free_m[1] - self._spec.cell_m
        along_m = self._along_m[slice(*np.searchsorted(self._along_m, (from_m, to_m)))]
        ahead, aside = _axes(bearing_rad)
        middle = eye_ne_m + along_m[:, None] * ahead
        if self._spec.is_proof:
            self._prove(eye_ne_m, middle, aside, time_s)
            return
        self._when_s[self._cells(middle + _ACROSS_LEG_M[:, None, None] * aside)] = time_s

    def _prove(self, eye_ne_m: Vector2, middle: Array, aside: Array, time_s: float) -> None:
        """Mark the cells with their middle within half a leg's width of the beam."""
        cell_m, wrap = self._spec.cell_m, self._spec.wrap
        north, east = (
            np.floor((middle[:, axis, None] + self._offsets_m * aside[axis]) / cell_m)
            for axis in (0, 1)
        )
        off_m = ((north + 0.5) * cell_m - eye_ne_m[0]) * aside[0]
        off_m += ((east + 0.5) * cell_m - eye_ne_m[1]) * aside[1]
        proved = np.abs(off_m) < LEG_M / 2
        rows, columns = (each[proved].astype(np.int64) & wrap for each in (north, east))
        self._when_s[rows, columns] = time_s

    def lane(
        self, place_ne_m: Vector2, bearing_rad: float, now_s: float, drift: Drift = NO_DRIFT
    ) -> Lane:
        """Return the swept part of the path at a bearing, rad.

        Beside the path, space has to be swept as far as the drone may have drifted since its beams
        swept the path: an obstacle there may stand in the path by now.
        """
        samples = self._samples
        north_m, east_m = (
            (samples.ahead_m * ahead + samples.aside_m * aside) + here_m
            for ahead, aside, here_m in zip(*_axes(bearing_rad), place_ne_m, strict=True)
        )
        age_s = now_s - self._when_s[self._number(north_m), self._number(east_m)]
        is_unswept = age_s >= LATELY_S
        oldest_s = np.where(is_unswept, 0.0, age_s)[:, samples.is_body].max(axis=1)
        drifted_m = DRIFT_SIGMAS * drift.sigma_m(oldest_s)
        is_unswept &= samples.beside_m < drifted_m[:, None]
        off_rad = samples.off_rad[is_unswept & (samples.reached_m < NEXT_M)]
        return Lane(
            float(samples.reached_m[is_unswept].min(initial=self._spec.to_m)),
            float(-off_rad.min(initial=0.0)),
            float(off_rad.max(initial=0.0)),
        )

    def when_s(self, north_m: Array, east_m: Array) -> Array:
        """Times, s, at which a beam last swept places; minus infinity if never. Any one shape."""
        when_s: Array = self._when_s[self._number(north_m), self._number(east_m)]
        return when_s

    def _cells(self, places_ne_m: Array) -> tuple[Indices, Indices]:
        cells = self._number(places_ne_m)
        return cells[..., 0], cells[..., 1]

    def _number(self, metres: Array) -> Indices:
        """Row or column of coordinates, wrapped around."""
        return np.floor(metres / self._spec.cell_m).astype(np.int64) & self._spec.wrap


@dataclass(frozen=True, slots=True)
class _PathSamples:
    """Samples of the path ahead and beside, each array (a, b): along and across the path."""

    ahead_m: Array
    aside_m: Array
    beside_m: Array
    """Distance of each sample from the space that the body passes, m; negative inside."""
    reached_m: Array
    """Distance that the drone flies until its body touches or passes each sample, m."""
    off_rad: Array
    """Angle of each sample to the right of the path, seen from the sensor, rad."""
    is_body: Mask
    """(b,): True for the samples across the path that the body passes."""

    @classmethod
    def of(cls, spec: GridSpec) -> "_PathSamples":
        body_m = np.arange(-BODY_RADIUS_M, BODY_RADIUS_M + spec.step_m, spec.cell_m)
        more_m = spec.cell_m * np.arange(1, math.ceil(spec.beside_m / spec.cell_m) + 1)
        across_m = np.concatenate([body_m[0] - more_m[::-1], body_m, body_m[-1] + more_m])
        ahead_m, aside_m = np.meshgrid(
            np.arange(spec.hull_m, spec.to_m, spec.cell_m), across_m, indexing="ij"
        )
        half_m = np.minimum(np.abs(aside_m), BODY_RADIUS_M)
        beside_m = np.abs(aside_m) - body_m[-1] - 0.5 * spec.cell_m
        reached_m = ahead_m - np.sqrt(spec.reach_m**2 - half_m**2)
        off_rad = np.arctan2(aside_m, ahead_m - EYE_M)
        return cls(ahead_m, aside_m, beside_m, reached_m, off_rad, beside_m[0] < 0)


def _disc(spec: GridSpec) -> Array:
    """Centres (n, 2) of the cells that the hull covers, m."""
    offsets = np.arange(-spec.hull_m, spec.hull_m + spec.step_m, spec.cell_m)
    places = np.stack(np.meshgrid(offsets, offsets, indexing="ij"), axis=-1).reshape(-1, 2)
    inside: Array = places[np.hypot(*places.T) <= spec.hull_m]
    return inside


def _axes(bearing_rad: float) -> tuple[Array, Array]:
    """Unit vectors along a bearing and to its right, each (2,)."""
    cos_b, sin_b = math.cos(bearing_rad), math.sin(bearing_rad)
    return np.array((cos_b, sin_b)), np.array((-sin_b, cos_b))

"""Where beams have gone lately, in cells finer than anything that stands on legs.

The points of `obstacle_memory.py` tell what was met. What no beam has met may stand there all the
same: the nose swings while the drone flies on, and a leg of 3 cm is easily missed. So it is known,
too, how far the drone may go until its body touches what none of them has gone through:

            ░░░░░ ░░░░░      ░ gone through, a gap between two beams
    drone ► ░░░░░ ░░░░░░░░
            ░░░░░░░░░░░
            ◄─► clear

And to which side of the way the nose is to turn next: as far as there are such gaps.

The cells lie in the frame of `obstacle_memory.py`, which only odometry moves, and the grid wraps
around: the other side of it is so far away that what was there is not lately any more.

There are two grids. In wide cells a beam that goes by near the middle of one has gone through it:
beams 5 cm apart leave none, though a leg may stand between them. In narrow cells a beam has gone
only through those in whose middle no leg can stand, or it would have been met: among legs, that is
proof, to half a cell, and takes longer.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import Vector2

LATELY_S = 30.0
"""Odometry drifts by less than a hand in so long. Chosen: with 6 s a flight takes a quarter longer,
for what was looked at from one leg of it is not known any more on the next."""
TO_M = 3.0
"""Farther off two readings of a beam that swings are more than a wide cell apart."""
LEG_M = 0.03
"""Nothing that stands is thinner: it is met by what passes its middle by half of that."""
BODY_M = 0.2
"""From the drone's centre to its hull: half the width of the way."""
EYE_M = 0.1
"""From the drone's centre to the sensor that looks along the way."""
NEXT_M = 1.5
"""The nose turns to gaps that the body touches within this. Chosen: over a straight way with legs,
1.5 and 2.2 m leave as few of them unmet; with 1 m the drone is slower and meets fewer."""
BESIDE_M = 0.6
"""From the middle of the way: what stands so near is one side of a passage. Chosen: a doorway of
1.2 m is passed in its middle, 0.4 m off either jamb."""
Places = NDArray[np.float64]
Cells = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Fill:
    """Which cells a beam has gone through, and how much of the way is looked at."""

    cell_m: float
    cells: int
    """Along either side of the grid."""
    to_m: float
    """So far ahead the way is known."""
    reach_m: float
    """From the drone's centre: the body and a cell."""
    is_proof: bool
    """Only cells in whose middle no leg can stand, not all that a beam as wide as one touches."""

    @property
    def hull_m(self) -> float:
        """From the drone's centre: the body and two cells, where nothing stands since it does."""
        return BODY_M + 2 * self.cell_m

    @property
    def step_m(self) -> float:
        """Between two places along or across the way, less than a cell."""
        return 0.5 * self.cell_m


WIDE = Fill(cell_m=0.05, cells=256, to_m=TO_M, reach_m=0.24, is_proof=False)
NARROW = Fill(cell_m=0.0125, cells=512, to_m=1.8, reach_m=0.2125, is_proof=True)
"""As far as the drone needs to stop from 1 m/s, and half a second before that."""


@dataclass(frozen=True, slots=True)
class Lane:
    """A way as wide as the drone, straight on from where it is."""

    clear_m: float = TO_M
    """So far, up to `TO_M`, the drone may go until it touches what no beam has gone through."""
    left_rad: float = 0.0
    right_rad: float = 0.0
    """To either side, off the way: as far as anything near is left to be looked at."""

    def beside(self, along_m: Places, aside_m: Places) -> "Lane":
        """With what stands near the way, (n,) along it and to the right of it, to be looked at."""
        is_near = (along_m > WIDE.hull_m) & (along_m < NEXT_M) & (np.abs(aside_m) < BESIDE_M)
        off_rad = np.arctan2(aside_m[is_near], along_m[is_near] - EYE_M)
        return Lane(
            self.clear_m,
            max(self.left_rad, float(-off_rad.min(initial=0.0))),
            max(self.right_rad, float(off_rad.max(initial=0.0))),
        )


def all_passed(bearing_frd_rad: float) -> Lane:
    """Where nothing is known of beams, they have gone everywhere."""
    return Lane()


class Passed:
    """When each cell was last gone through."""

    def __init__(self, fill: Fill = WIDE) -> None:
        self._fill = fill
        self._when_s = np.full((fill.cells, fill.cells), -math.inf)
        self._hull = _disc(fill)
        self._along_m = np.arange(0.0, fill.to_m, fill.step_m)
        self._way = _Way.of(fill)

    def stand(self, place_ne_m: Vector2, time_s: float) -> None:
        """The drone is there."""
        self._when_s[self._cells(self._hull + place_ne_m)] = time_s

    def go(self, eye_ne_m: Vector2, bearing_rad: float, free_m: Vector2, time_s: float) -> None:
        """A beam has gone from and to so far from its eye."""
        from_m, to_m = free_m[0], free_m[1] - self._fill.cell_m
        along_m = self._along_m[slice(*np.searchsorted(self._along_m, (from_m, to_m)))]
        ahead, aside = _axes(bearing_rad)
        middle = eye_ne_m + along_m[:, None] * ahead
        if self._fill.is_proof:
            self._prove(eye_ne_m, middle, aside, time_s)
            return
        for off_m in (-LEG_M / 2, 0.0, LEG_M / 2):
            self._when_s[self._cells(middle + off_m * aside)] = time_s

    def _prove(self, eye_ne_m: Vector2, middle: Places, aside: Places, time_s: float) -> None:
        """The middle of a cell lies within half a leg of the beam."""
        cell_m = self._fill.cell_m
        offsets_m = np.arange(-LEG_M / 2, LEG_M / 2, self._fill.step_m)
        near = (middle[:, None] + offsets_m[:, None] * aside).reshape(-1, 2)
        numbers = np.floor(near / cell_m).astype(np.int64)
        off_m = np.abs(((numbers + 0.5) * cell_m - eye_ne_m) @ aside)
        proved = numbers[off_m < LEG_M / 2] % self._fill.cells
        self._when_s[tuple(proved.T)] = time_s

    def lane(self, place_ne_m: Vector2, bearing_rad: float, now_s: float) -> Lane:
        """What is known of the way to a bearing."""
        ahead, aside = _axes(bearing_rad)
        way = self._way
        places = way.ahead_m[:, None] * ahead + way.aside_m[:, None] * aside + place_ne_m
        is_left = self.when_s(places) <= now_s - LATELY_S
        off_rad = way.off_rad[is_left & (way.reached_m < NEXT_M)]
        return Lane(
            float(way.reached_m[is_left].min(initial=self._fill.to_m)),
            float(-off_rad.min(initial=0.0)),
            float(off_rad.max(initial=0.0)),
        )

    def when_s(self, places_ne_m: Places) -> Places:
        """Of places (..., 2): when a beam has gone through there last, (...), or minus infinity."""
        when_s: Places = self._when_s[self._cells(places_ne_m)]
        return when_s

    def _cells(self, places_ne_m: Places) -> tuple[Cells, Cells]:
        cells = np.floor(places_ne_m / self._fill.cell_m).astype(np.int64) % self._fill.cells
        return cells[..., 0], cells[..., 1]


@dataclass(frozen=True, slots=True)
class _Way:
    """Places of the way ahead, each (n,)."""

    ahead_m: Places
    aside_m: Places
    reached_m: Places
    """How far the drone goes until its body touches each."""
    off_rad: Places
    """How far to the right of the way each lies, from the sensor."""

    @classmethod
    def of(cls, fill: Fill) -> "_Way":
        ahead_m, aside_m = (
            each.ravel()
            for each in np.meshgrid(
                np.arange(fill.hull_m, fill.to_m, fill.cell_m),
                np.arange(-BODY_M, BODY_M + fill.step_m, fill.cell_m),
                indexing="ij",
            )
        )
        reached_m = ahead_m - np.sqrt(fill.reach_m**2 - aside_m**2)
        return cls(ahead_m, aside_m, reached_m, np.arctan2(aside_m, ahead_m - EYE_M))


def _disc(fill: Fill) -> Places:
    """(n, 2): middles of the cells that the hull covers."""
    offsets = np.arange(-fill.hull_m, fill.hull_m + fill.step_m, fill.cell_m)
    places = np.stack(np.meshgrid(offsets, offsets, indexing="ij"), axis=-1).reshape(-1, 2)
    inside: Places = places[np.hypot(*places.T) <= fill.hull_m]
    return inside


def _axes(bearing_rad: float) -> tuple[Places, Places]:
    """Unit vectors along a bearing, and to the right of it."""
    cos_b, sin_b = math.cos(bearing_rad), math.sin(bearing_rad)
    return np.array((cos_b, sin_b)), np.array((-sin_b, cos_b))

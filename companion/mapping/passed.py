"""Where beams have gone lately, in cells finer than anything that stands on legs.

The points of `near.py` tell what was met. What no beam has met may stand there all the same: the
nose swings while the drone flies on, and a leg of 3 cm is easily missed. So it is known, too, how
far the drone may go until its body touches what none of them has gone through:

            ░░░░░ ░░░░░      ░ gone through, a gap between two beams
    drone ► ░░░░░ ░░░░░░░░
            ░░░░░░░░░░░
            ◄─► clear

And to which side of the way the nose is to turn next: as far as there are such gaps.

The cells lie in the frame of `near.py`, which only odometry moves, and the grid wraps around: the
other side of it is so far away that what was there is not lately any more.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.frames import Vector2

CELL_M, CELLS = 0.05, 256
LATELY_S = 30.0
"""Odometry drifts by less than a hand in so long. Chosen: with 6 s a flight takes a quarter longer,
for what was looked at from one leg of it is not known any more on the next."""
TO_M = 3.0
"""Farther off two readings of a beam that swings are more than a cell apart."""
LEG_M = 0.03
"""Nothing that stands is thinner: it is met by what passes its middle by half of that."""
HULL_M = 0.3
"""From the drone's centre: the body and two cells, where nothing stands since the drone does."""
HALF_WIDTH_M = 0.2
"""Of the way: the body's."""
REACH_M = 0.24
"""From the drone's centre: the body and a cell."""
EYE_M = 0.1
"""From the drone's centre to the sensor that looks along the way."""
NEXT_M = 1.5
"""The nose turns to gaps that the body touches within this. Chosen: over a straight way with legs,
1.5 and 2.2 m leave as few of them unmet; with 1 m the drone is slower and meets fewer."""
BESIDE_M = 0.6
"""From the middle of the way: what stands so near is one side of a passage. Chosen: a doorway of
1.2 m is passed in its middle, 0.4 m off either jamb."""
STEP_M = 0.5 * CELL_M
Places = NDArray[np.float64]
Cells = NDArray[np.int64]


def _disc() -> Places:
    """(n, 2): middles of the cells that the hull covers."""
    offsets = np.arange(-HULL_M, HULL_M + STEP_M, CELL_M)
    places = np.stack(np.meshgrid(offsets, offsets, indexing="ij"), axis=-1).reshape(-1, 2)
    inside: Places = places[np.hypot(*places.T) <= HULL_M]
    return inside


_DISC = _disc()
_ALONG_M = np.arange(0.0, TO_M, STEP_M)
_AHEAD_M, _ASIDE_M = (
    each.ravel()
    for each in np.meshgrid(
        np.arange(HULL_M, TO_M, CELL_M),
        np.arange(-HALF_WIDTH_M, HALF_WIDTH_M + STEP_M, CELL_M),
        indexing="ij",
    )
)
_REACHED_M = _AHEAD_M - np.sqrt(REACH_M**2 - _ASIDE_M**2)
"""(n,): how far the drone goes until its body touches each place of the way."""
_OFF_RAD = np.arctan2(_ASIDE_M, _AHEAD_M - EYE_M)
"""(n,): how far to the right of the way each lies, from the sensor."""


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
        is_near = (along_m > HULL_M) & (along_m < NEXT_M) & (np.abs(aside_m) < BESIDE_M)
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

    def __init__(self) -> None:
        self._when_s = np.full((CELLS, CELLS), -math.inf)

    def stand(self, place_ne_m: Vector2, time_s: float) -> None:
        """The drone is there."""
        self._when_s[_cells(_DISC + place_ne_m)] = time_s

    def go(self, eye_ne_m: Vector2, bearing_rad: float, free_m: Vector2, time_s: float) -> None:
        """A beam has gone from and to so far from its eye."""
        from_m, to_m = free_m
        along_m = _ALONG_M[slice(*np.searchsorted(_ALONG_M, (from_m, to_m - CELL_M)))]
        ahead, aside = _axes(bearing_rad)
        middle = eye_ne_m + along_m[:, None] * ahead
        for off_m in (-LEG_M / 2, 0.0, LEG_M / 2):
            self._when_s[_cells(middle + off_m * aside)] = time_s

    def lane(self, place_ne_m: Vector2, bearing_rad: float, now_s: float) -> Lane:
        """What is known of the way to a bearing."""
        ahead, aside = _axes(bearing_rad)
        places = _AHEAD_M[:, None] * ahead + _ASIDE_M[:, None] * aside + place_ne_m
        is_left = self.when_s(places) <= now_s - LATELY_S
        off_rad = _OFF_RAD[is_left & (_REACHED_M < NEXT_M)]
        return Lane(
            float(_REACHED_M[is_left].min(initial=TO_M)),
            float(-off_rad.min(initial=0.0)),
            float(off_rad.max(initial=0.0)),
        )

    def when_s(self, places_ne_m: Places) -> Places:
        """Of places (..., 2): when a beam has gone through there last, (...), or minus infinity."""
        when_s: Places = self._when_s[_cells(places_ne_m)]
        return when_s


def _axes(bearing_rad: float) -> tuple[Places, Places]:
    """Unit vectors along a bearing, and to the right of it."""
    cos_b, sin_b = math.cos(bearing_rad), math.sin(bearing_rad)
    return np.array((cos_b, sin_b)), np.array((-sin_b, cos_b))


def _cells(places_ne_m: Places) -> tuple[Cells, Cells]:
    cells = np.floor(places_ne_m / CELL_M).astype(np.int64) % CELLS
    return cells[..., 0], cells[..., 1]

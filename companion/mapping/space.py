"""The space around, kept as rays, so that it can be drawn anew when the trajectory is set right.

Each ray is kept relative to the keyframe before it. When the flight so far has been smoothed, a new
grid is drawn from all rays and the corrected keyframes, a piece at each tick, and then takes the
place of the old one.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.frames import Vector2, frd_to_ned, ned_to_frd, wrap_rad
from companion.mapping.occupancy import Occupancy, Ray

Array = NDArray[np.float64]
"""Keyframes (k, 3): north, east, yaw."""

RAYS_A_PIECE = 60


class _KeptRay(NamedTuple):
    keyframe: int
    offset_frd_m: Vector2
    bearing_frd_rad: float
    ray: Ray


class Space:
    """The grid that the flight uses, and what it was drawn from."""

    def __init__(self) -> None:
        self.grid = Occupancy()
        self._kept: list[_KeptRay] = []
        self._drawing: Iterator[Occupancy | None] | None = None

    def add(self, rays: Sequence[Ray], keyframes: Array) -> None:
        """Take in what was seen from a pose shortly after the last keyframe."""
        if not len(keyframes):
            return
        north_m, east_m, yaw_rad = keyframes[-1].tolist()
        for ray in rays:
            offset = ned_to_frd(ray.origin_ne_m[0] - north_m, ray.origin_ne_m[1] - east_m, yaw_rad)
            bearing_rad = wrap_rad(ray.bearing_rad - yaw_rad)
            self._kept.append(_KeptRay(len(keyframes) - 1, offset, bearing_rad, ray))
            self.grid.add(ray)

    def redraw(self, keyframes: Array) -> None:
        """Begin a new grid: the trajectory has been corrected."""
        self._drawing = self._pieces(keyframes.copy())

    def advance(self) -> None:
        """Draw some more, if there is something to draw."""
        if self._drawing is None:
            return
        grid = next(self._drawing)
        if grid is not None:
            self.grid, self._drawing = grid, None

    def _pieces(self, keyframes: Array) -> Iterator[Occupancy | None]:
        grid, done = Occupancy(), 0
        while done < len(self._kept):
            for kept in self._kept[done : done + RAYS_A_PIECE]:
                grid.add(_placed(kept, keyframes))
            done += RAYS_A_PIECE
            yield None
        yield grid


def _placed(kept: _KeptRay, keyframes: Array) -> Ray:
    """Where the ray lies by the corrected keyframe; one that is newer stays where it was seen."""
    if kept.keyframe >= len(keyframes):
        return kept.ray
    frame_north_m, frame_east_m, yaw_rad = keyframes[kept.keyframe].tolist()
    north_m, east_m = frd_to_ned(*kept.offset_frd_m, yaw_rad)
    origin = frame_north_m + north_m, frame_east_m + east_m
    bearing_rad = math.remainder(yaw_rad + kept.bearing_frd_rad, math.tau)
    return Ray(origin, bearing_rad, kept.ray.end_m, kept.ray.sigma_m, kept.ray.is_hit)

"""The space around, kept as rays, so that it can be drawn anew when the trajectory is set right.

Each ray is kept relative to the keyframe before it. When smoothing has moved any keyframe by about
half a cell since its rays were drawn, a new grid is drawn from all rays and the corrected
keyframes, a piece at each tick, and then takes the place of the old one.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from companion.frames import ned_to_frd
from companion.mapping.occupancy import CELL_M, Occupancy, Ray, Rays

Array = NDArray[np.float64]
"""Keyframes (k, 3): north, east, yaw."""

RAYS_A_PIECE = 200
MOST_RAYS = 60_000
"""Twelve minutes of all beams; then every second of the older ones is forgotten."""
MOVED_M, TURNED_RAD = 0.6 * CELL_M, math.radians(1.0)
RAYS_AT_ONCE = 12
"""Some ticks' rays are drawn together, which takes hardly longer than one."""
_KEYFRAME, _FORWARD, _RIGHT, _BEARING, _END, _SIGMA, _IS_HIT = range(7)


class Space:
    """The grid that the flight uses, and what it was drawn from."""

    def __init__(self) -> None:
        self.grid = Occupancy()
        self._rays = np.empty((256, 7))
        self._count = 0
        self._drawn: Array = np.empty((0, 3))
        """The keyframes as they were when their rays were drawn."""
        self._drawing: Iterator[Occupancy | None] | None = None
        self._waiting: list[Ray] = []

    def add(self, rays: Sequence[Ray], keyframes: Array) -> None:
        """Take in what was seen from a pose shortly after the last keyframe."""
        if not len(keyframes) or not rays:
            return
        if len(keyframes) > len(self._drawn):
            self._drawn = np.vstack([self._drawn, keyframes[len(self._drawn) :]])
        self._waiting += rays
        if len(self._waiting) >= RAYS_AT_ONCE:
            self.grid.draw(Rays.of(self._waiting))
            self._waiting = []
        north_m, east_m, yaw_rad = keyframes[-1].tolist()
        for ray in rays:
            origin_north_m, origin_east_m = ray.origin_ne_m
            offset = ned_to_frd(origin_north_m - north_m, origin_east_m - east_m, yaw_rad)
            self._keep(
                len(keyframes) - 1,
                *offset,
                ray.bearing_rad - yaw_rad,
                ray.end_m,
                ray.sigma_m,
                float(ray.is_hit),
            )

    def _keep(self, *row: float) -> None:
        if self._count >= MOST_RAYS and self._drawing is None:
            older = self._rays[: self._count // 2 : 2]
            left = np.concatenate([older, self._rays[self._count // 2 : self._count]])
            self._count = len(left)
            self._rays[: self._count] = left
        if self._count == len(self._rays):
            self._rays = np.concatenate([self._rays, np.empty_like(self._rays)])
        self._rays[self._count] = row
        self._count += 1

    def correct(self, keyframes: Array) -> None:
        """The trajectory has been set right: begin a new grid, if that makes a difference."""
        known = min(len(keyframes), len(self._drawn))
        off = keyframes[:known] - self._drawn[:known]
        turned_rad = np.abs((off[:, 2] + math.pi) % math.tau - math.pi)
        if (np.hypot(off[:, 0], off[:, 1]) > MOVED_M).any() or (turned_rad > TURNED_RAD).any():
            self._drawn = keyframes.copy()
            self._drawing = self._pieces()

    def advance(self) -> None:
        """Draw some more, if there is something to draw."""
        if self._drawing is None:
            return
        grid = next(self._drawing)
        if grid is not None:
            self.grid, self._drawing, self._waiting = grid, None, []

    def _pieces(self) -> Iterator[Occupancy | None]:
        grid, done = Occupancy(), 0
        while done < self._count:
            some = self._rays[done : min(done + RAYS_A_PIECE, self._count)]
            grid.draw(_placed(some, self._drawn))
            done += len(some)
            yield None
        yield grid


def _placed(rays: Array, keyframes: Array) -> Rays:
    """Where the rays (r, 7) lie by the keyframes."""
    frames = keyframes[rays[:, _KEYFRAME].astype(np.int64)]
    cos_yaw, sin_yaw = np.cos(frames[:, 2]), np.sin(frames[:, 2])
    forward, right = rays[:, _FORWARD], rays[:, _RIGHT]
    origin = frames[:, :2] + np.column_stack(
        [cos_yaw * forward - sin_yaw * right, sin_yaw * forward + cos_yaw * right]
    )
    return Rays(
        origin,
        frames[:, 2] + rays[:, _BEARING],
        rays[:, _END],
        rays[:, _SIGMA],
        rays[:, _IS_HIT] > 0,
    )

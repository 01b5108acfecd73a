"""The space around, kept as rays, so that it can be drawn anew when the trajectory is set right.

Each ray is kept relative to the keyframe before it. When smoothing has moved a keyframe by about
half a cell since its rays were drawn, all from there on are drawn again, a piece at each tick:

    rays   |---------------|---------------|--------*------|-----|
           0             stage           stage    moved       now
                                           |═════════════════════>  drawn again

A stage is a copy of the grid as it was after so many rays. Until the drawing has come to the end,
the flight goes on with the grid as it was. Of a long flight the oldest rays are forgotten; what
they have drawn stays, where it is: so late, only the last part of the flight is still set right.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import ned_to_frd
from companion.mapping.occupancy import CELL_M, Occupancy, Ray, Rays

Array = NDArray[np.float64]
"""Keyframes (k, 3): north, east, yaw."""

RAYS_A_PIECE = 200
MAX_RAYS = 60_000
"""Twelve minutes of all beams; then the older half, about, is forgotten."""
MOVED_M, TURNED_RAD = 0.6 * CELL_M, math.radians(1.0)
RAYS_AT_ONCE = 12
"""Some ticks' rays are drawn together, which takes hardly longer than one."""
RAYS_A_STAGE = 500
MAX_STAGES = 12
_KEYFRAME, _FORWARD, _RIGHT, _BEARING, _END, _SIGMA, _IS_HIT, _TIME = range(8)


class RedrawnGrid:
    """The grid that the flight uses, and what it was drawn from."""

    def __init__(self, begun: Occupancy | None = None) -> None:
        """`begun`: what is known before anything was seen; not to be used otherwise."""
        self.grid = begun or Occupancy()
        self._canvas = self.grid
        """The same, or what will take its place when all is drawn."""
        self._drawn_rays = 0
        self._stages: list[tuple[int, Occupancy]] = [(0, self.grid.copy())]
        self._rays = np.empty((256, 8))
        self._count = 0
        self._drawn: Array = np.empty((0, 3))
        """The keyframes as they were when their rays were drawn."""

    def add(self, rays: Sequence[Ray], keyframes: Array) -> None:
        """Take in what was seen from a pose shortly after the last keyframe."""
        if not len(keyframes) or not rays:
            return
        if len(keyframes) > len(self._drawn):
            self._drawn = np.vstack([self._drawn, keyframes[len(self._drawn) :]])
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
                ray.time_s,
            )

    def _keep(self, *row: float) -> None:
        if self._count >= MAX_RAYS and self._canvas is self.grid:
            self._forget()
        if self._count == len(self._rays):
            self._rays = np.concatenate([self._rays, np.empty_like(self._rays)])
        self._rays[self._count] = row
        self._count += 1

    def _forget(self) -> None:
        """Go on from a stage about half way, or from all that was drawn, as if from the start."""
        stages = [*self._stages[1:], (self._drawn_rays, self._canvas.copy())]
        half = self._count // 2
        gone, begun = min(stages, key=lambda stage: abs(stage[0] - half))
        self._stages = [(0, begun), *((n - gone, grid) for n, grid in stages[:-1] if n > gone)]
        self._rays = self._rays[gone:].copy()
        self._count -= gone
        self._drawn_rays -= gone

    def correct(self, keyframes: Array) -> None:
        """The trajectory has been set right: begin anew where that makes a difference."""
        known = min(len(keyframes), len(self._drawn))
        off = keyframes[:known] - self._drawn[:known]
        turned_rad = np.abs((off[:, 2] + math.pi) % math.tau - math.pi)
        moved = (np.hypot(off[:, 0], off[:, 1]) > MOVED_M) | (turned_rad > TURNED_RAD)
        keyframe_of = self._rays[: self._count, _KEYFRAME]
        moved[: int(keyframe_of[0]) if self._count else known] = False  # what is forgotten stays
        if not moved.any():
            return
        first = int(moved.argmax())
        first_ray = int(np.searchsorted(keyframe_of, first))
        if first_ray < self._drawn_rays:
            while self._stages[-1][0] > first_ray:
                self._stages.pop()
            self._drawn_rays, stage = self._stages[-1]
            self._canvas = stage.copy()
            first = int(keyframe_of[self._drawn_rays])
        self._drawn[first:known] = keyframes[first:known]

    def advance(self) -> None:
        """Draw some more, if there is enough to draw."""
        is_behind = self._canvas is not self.grid
        if self._count - self._drawn_rays < (1 if is_behind else RAYS_AT_ONCE):
            return
        end = min(self._drawn_rays + RAYS_A_PIECE, self._count)
        self._canvas.draw(_placed(self._rays[self._drawn_rays : end], self._drawn))
        self._drawn_rays = end
        if end - self._stages[-1][0] >= RAYS_A_STAGE:
            self._stages.append((end, self._canvas.copy()))
            if len(self._stages) > MAX_STAGES:
                del self._stages[1 : MAX_STAGES // 2 : 2]  # the latest are the likeliest to help
        if end == self._count:
            self.grid = self._canvas


def _placed(rays: Array, keyframes: Array) -> Rays:
    """Where the rays (r, 8) lie by the keyframes."""
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
        rays[:, _TIME],
    )

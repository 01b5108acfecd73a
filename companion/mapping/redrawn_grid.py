"""Stores the readings as rays and redraws the occupancy grid after corrections of the trajectory.

Each ray is stored relative to its preceding keyframe. When smoothing has moved a keyframe by about
half a cell since its rays were drawn, all rays from there on are redrawn, in pieces, one per tick:

    rays   |---------------|---------------|--------*------|-----|
           0             stage           stage    moved       now
                                           |═════════════════════>  redrawn

A stage is a copy of the grid after some number of rays. Until the redrawing is complete, the flight
uses the old grid. In a long flight the oldest rays are dropped, and what they have drawn stays in
place. By then smoothing corrects only the last part of the flight.
"""

import math
from collections.abc import Sequence

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import ned_to_frd, wrap_rad
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.mapping.packed_grid import PackedGrid
from companion.mapping.rays import Ray, Rays

RAYS_PER_PIECE = 200
"""Rays drawn per tick. Chosen."""
MAX_RAYS = 60_000
"""Most rays stored: twelve minutes of all beams. Then about the older half is dropped. Chosen."""
MOVED_M, TURNED_RAD = 0.6 * CELL_M, math.radians(1.0)
"""Larger shifts or turns of a keyframe cause a redraw. Chosen."""
MIN_BATCH_RAYS = 12
"""Least rays drawn together: those of some ticks take hardly longer than one. Chosen."""
RAYS_PER_STAGE = 500
"""Rays between two stages. Chosen."""
MAX_STAGES = 12
"""Most stages stored. Chosen."""
RAY_COLUMNS = 8
_KEYFRAME, _FORWARD, _RIGHT, _BEARING, _END, _SIGMA, _IS_HIT, _TIME = range(RAY_COLUMNS)
"""Columns of a stored ray. Offset and bearing are relative to the keyframe."""


class RedrawnGrid:
    """The grid used in flight, and the rays that it is drawn from."""

    def __init__(
        self,
        begun: Occupancy | None = None,
        *,
        moved_m: float = MOVED_M,
        rays_per_stage: int = RAYS_PER_STAGE,
    ) -> None:
        """`begun`: initial grid; the caller must not use it further.

        `moved_m`: larger shifts of a keyframe cause a redraw, m. `rays_per_stage`: rays between two
        stages.
        """
        self.grid = begun or Occupancy()
        self._moved_m, self._rays_per_stage = moved_m, rays_per_stage
        self._canvas = self.grid
        """`grid` itself, or its replacement while that is being drawn."""
        self._drawn_rays = 0
        self._stages = [(0, PackedGrid.of(self.grid))]
        self._dropped: list[Array] = []
        """Oldest rays, which are not redrawn in flight any more."""
        self._rays = np.empty((256, RAY_COLUMNS))
        self._count = 0
        self._drawn: Array = np.empty((0, 3))
        """The keyframes at the time their rays were drawn."""

    def add(self, rays: Sequence[Ray], keyframes: Array) -> None:
        """Add readings taken shortly after the last keyframe."""
        if not len(keyframes) or not rays:
            return
        self._know(keyframes)
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

    def extend(self, rays: Array, keyframes: Array) -> None:
        """Add rays (r, 8) as `rays_from` returns them; their keyframes are the last of (k, 3)."""
        self._know(keyframes)
        for row in rays.tolist():
            self._keep(*row)

    def _know(self, keyframes: Array) -> None:
        if len(keyframes) > len(self._drawn):
            self._drawn = np.vstack([self._drawn, keyframes[len(self._drawn) :]])

    def _keep(self, *row: float) -> None:
        if self._count >= MAX_RAYS and self._canvas is self.grid:
            self._drop_oldest()
        if self._count == len(self._rays):
            self._rays = np.concatenate([self._rays, np.empty_like(self._rays)])
        self._rays[self._count] = row
        self._count += 1

    def _drop_oldest(self) -> None:
        """Drop the rays before a stage about half way; the stage becomes the initial grid."""
        stages = [*self._stages[1:], (self._drawn_rays, PackedGrid.of(self._canvas))]
        half = self._count // 2
        dropped, begun = min(stages, key=lambda stage: abs(stage[0] - half))
        self._stages = [
            (0, begun),
            *((n - dropped, grid) for n, grid in stages[:-1] if n > dropped),
        ]
        self._dropped.append(self._rays[:dropped].copy())
        self._rays = self._rays[dropped:].copy()
        self._count -= dropped
        self._drawn_rays -= dropped

    def correct(self, keyframes: Array) -> None:
        """Process corrected keyframes; start a redraw where they differ enough."""
        known = min(len(keyframes), len(self._drawn))
        off = keyframes[:known] - self._drawn[:known]
        turned_rad = np.abs(wrap_rad(off[:, 2]))
        moved = (np.hypot(off[:, 0], off[:, 1]) > self._moved_m) | (turned_rad > TURNED_RAD)
        keyframe_of = self._rays[: self._count, _KEYFRAME]
        moved[: int(keyframe_of[0]) if self._count else known] = False  # dropped rays stay as drawn
        if not moved.any():
            return
        first = int(moved.argmax())
        first_ray = int(np.searchsorted(keyframe_of, first))
        if first_ray < self._drawn_rays:
            while self._stages[-1][0] > first_ray:
                self._stages.pop()
            self._drawn_rays, stage = self._stages[-1]
            self._canvas = stage.unpacked()
            first = int(keyframe_of[self._drawn_rays])
        self._drawn[first:known] = keyframes[first:known]

    @property
    def rays(self) -> Array:
        """(r, 8): all rays of the flight, for `draw_onto`."""
        return np.concatenate([*self._dropped, self._rays[: self._count]])

    @property
    def ray_count(self) -> int:
        """Number of rays of the flight."""
        return sum(map(len, self._dropped)) + self._count

    def rays_from(self, first: int, count: int) -> Array:
        """(count, 8): consecutive rays of the flight, from number `first` on."""
        before = sum(map(len, self._dropped))
        if first >= before:
            return self._rays[first - before : first - before + count]
        return self.rays[first : first + count]

    def advance(self) -> None:
        """Draw the next rays if there are enough."""
        is_behind = self._canvas is not self.grid
        if self._count - self._drawn_rays < (1 if is_behind else MIN_BATCH_RAYS):
            return
        end = min(self._drawn_rays + RAYS_PER_PIECE, self._count)
        self._canvas.draw(_placed(self._rays[self._drawn_rays : end], self._drawn))
        self._drawn_rays = end
        if end - self._stages[-1][0] >= self._rays_per_stage:
            self._stages.append((end, PackedGrid.of(self._canvas)))
            if len(self._stages) > MAX_STAGES:
                del self._stages[1 : MAX_STAGES // 2 : 2]  # the latest stages are the most useful
        if end == self._count:
            self.grid = self._canvas


def draw_onto(grid: Occupancy, rays: Array, keyframes: Array) -> None:
    """Draw the rays (r, 8) of a flight onto a grid, by its keyframes (k, 3)."""
    for low in range(0, len(rays), RAYS_PER_STAGE):
        grid.draw(_placed(rays[low : low + RAYS_PER_STAGE], keyframes))


def _placed(rays: Array, keyframes: Array) -> Rays:
    """Place the rays (r, 8) by the keyframes."""
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

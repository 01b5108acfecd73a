"""What the smoother needs of the flight: a pose every 0.2 s, what was measured between, and hits.

All in frames that nothing estimated has touched: displacements and hits are relative to the
keyframe before them, by raw odometry and gyro. Kept as columns of numbers, which an hour of flight
fills with some tens of megabytes, and which the smoother takes as they are.
"""

import math
from collections.abc import Sequence
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import Vector2, ned_to_frd
from companion.core.messages import Pose
from companion.estimation.filters.dead_reckoning import moved

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

PERIOD_S = 0.2
NO_WALL = -1
MAX_HITS = 60_000
"""Twelve minutes of all beams. Of a longer flight only every second, fourth, ... sweep is kept,"""
FRESH_S = 60.0
"""but all of the last minute."""
SWEEP_S = 0.05


class FrameColumn(IntEnum):
    """Of a keyframe: its motion since the one before, in that one's body frame, and its pose."""

    TIME_S = 0
    FORWARD_M = 1
    """By odometry, its scale not corrected."""
    RIGHT_M = 2
    TURNED_RAD = 3
    """By the gyro, neither bias nor scale corrected."""
    NORTH_M = 4
    """The pose as it is known so far."""
    EAST_M = 5
    YAW_RAD = 6
    DOWN_M = 7
    POSITION_SIGMA_M = 8
    YAW_SIGMA_RAD = 9
    AUTOPILOT_YAW_RAD = 10
    """Turned since take-off by the autopilot, not wrapped; not a number while it tells nothing."""
    GAP_RAD2 = 11
    """Variance of what was turned while the gyro was silent."""


class HitColumn(IntEnum):
    """Of one return of a beam, relative to its keyframe's position and heading."""

    TIME_S = 0
    BEAM = 1
    """Its place in `BEAMS`."""
    FRAME = 2
    FORWARD_M = 3
    """Where the drone was."""
    RIGHT_M = 4
    BEARING_RAD = 5
    """Where the beam pointed, off the keyframe's heading."""
    DISTANCE_M = 6
    """From the sensor."""
    DOWN_M = 7
    WALL = 8
    """The wall it is on as far as known, or `NO_WALL`."""
    LATE_S = 9
    """How long after the last odometry it was measured: for so long its place is extrapolated."""


class Table:
    """Rows of numbers, to which more are appended."""

    def __init__(self, columns: int) -> None:
        self._rows = np.empty((256, columns))
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, row: Sequence[float]) -> None:
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[self._count] = row
        self._count += 1

    @property
    def rows(self) -> Array:
        """(n, columns): a view, which is valid until the next change."""
        return self._rows[: self._count]

    def keep(self, kept: NDArray[np.bool_]) -> None:
        """Forget all rows but those of the mask (n,)."""
        left = self.rows[kept]
        self._count = len(left)
        self._rows[: self._count] = left


class FlightRecord:
    """Keyframes and hits from the first moment on."""

    def __init__(self) -> None:
        self._frames = Table(len(FrameColumn))
        self._hits = Table(len(HitColumn))
        self._stride = 1
        self._last_s = -PERIOD_S
        self._raw_ne_m: Vector2 = (0.0, 0.0)
        self._raw_yaw_rad = 0.0
        self._moved_frd_m: Vector2 = (0.0, 0.0)
        self._turned_rad = 0.0
        self._gap_rad2 = 0.0

    @property
    def frames(self) -> Array:
        """(k, FrameColumn): a view."""
        return self._frames.rows

    @property
    def poses(self) -> Array:
        """(k, 3): north, east, yaw of the keyframes, as known so far; a view."""
        return self.frames[:, FrameColumn.NORTH_M : FrameColumn.YAW_RAD + 1]

    @property
    def hits(self) -> Array:
        """(n, HitColumn): a view."""
        return self._hits.rows

    @property
    def raw(self) -> tuple[Vector2, float]:
        """Raw dead-reckoned place and yaw of the last keyframe."""
        return self._raw_ne_m, self._raw_yaw_rad

    def bridge(self, variance_rad2: float) -> None:
        """The gyro was silent: what was turned meanwhile is known no better than this."""
        self._gap_rad2 += variance_rad2

    def bridged_since_rad2(self, time_s: float) -> float:
        """The same of all silences since then."""
        is_since = self.frames[:, FrameColumn.TIME_S] > time_s
        return float(self.frames[is_since, FrameColumn.GAP_RAD2].sum()) + self._gap_rad2

    def advance(
        self, pose: Pose, raw_ne_m: Vector2, raw_yaw_rad: float, autopilot_yaw_rad: float = math.nan
    ) -> None:
        """The drone is here by now, there by uncorrected dead reckoning, turned as it is told."""
        north_m, east_m = raw_ne_m[0] - self._raw_ne_m[0], raw_ne_m[1] - self._raw_ne_m[1]
        self._moved_frd_m = ned_to_frd(north_m, east_m, self._raw_yaw_rad)
        self._turned_rad = raw_yaw_rad - self._raw_yaw_rad
        if pose.time_s - self._last_s < PERIOD_S - 1e-6:
            return
        place = pose.north_m, pose.east_m, pose.yaw_rad, pose.down_m
        sigmas = pose.position_sigma_m, pose.yaw_sigma_rad
        motion = *self._moved_frd_m, self._turned_rad
        self._frames.append(
            (pose.time_s, *motion, *place, *sigmas, autopilot_yaw_rad, self._gap_rad2)
        )
        self._last_s = pose.time_s
        self._raw_ne_m, self._raw_yaw_rad = raw_ne_m, raw_yaw_rad
        self._moved_frd_m, self._turned_rad, self._gap_rad2 = (0.0, 0.0), 0.0, 0.0

    def add_hit(
        self,
        pose: Pose,
        beam: int,
        distance_m: float,
        measured_at: tuple[Vector2, float],
        wall: int | None,
        *,
        late_s: float = 0.0,
    ) -> None:
        """A hit read now.

        `measured_at` is the motion from the last odometry, forward and right, to where it was
        measured, `late_s` later, and the bearing of the beam then, off the nose now.
        """
        back_m, bearing_frd_rad = measured_at
        forward_m, right_m = moved(self._moved_frd_m, back_m, self._turned_rad)
        self._hits.append(
            (
                pose.time_s,
                beam,
                len(self._frames) - 1,
                forward_m,
                right_m,
                self._turned_rad + bearing_frd_rad,
                distance_m,
                pose.down_m,
                NO_WALL if wall is None else wall,
                late_s,
            )
        )

    def thin(self) -> None:
        """Keep no more hits than there is room for; those of the whole flight equally."""
        while len(self._hits) > MAX_HITS:
            self._stride *= 2
            time_s = self.hits[:, HitColumn.TIME_S]
            fresh = time_s > time_s[-1] - FRESH_S
            self._hits.keep(fresh | (np.rint(time_s / SWEEP_S) % self._stride == 0))

    def correct(self, first: int, poses: Array, first_hit: int, wall_of: Indices) -> None:
        """Better poses (k, 3), north, east, yaw, from keyframe `first` on; hits' walls likewise.

        Hits that came later belong to walls by numbers that are no longer theirs: to none.
        """
        self.poses[first : first + len(poses)] = poses
        walls = self.hits[first_hit:, HitColumn.WALL]
        walls[: len(wall_of)] = wall_of
        walls[len(wall_of) :] = NO_WALL

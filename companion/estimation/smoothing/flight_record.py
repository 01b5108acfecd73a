"""Records the flight for the smoother: a keyframe every 0.2 s, the motion between, and all hits.

The record contains no estimates: displacements and hits are relative to the preceding keyframe, by
raw odometry and gyro. It is stored as columns of numbers. An hour of flight needs tens of
megabytes, and the smoother uses them without conversion.
"""

import math
from collections.abc import Sequence
from enum import IntEnum

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2, moved, ned_to_frd
from companion.core.messages import Pose

PERIOD_S = 0.2
"""Interval of the keyframes, s. Chosen."""
NO_WALL = -1
"""Wall index of hits without a wall."""
MAX_HITS = 60_000
"""Most hits stored: twelve minutes of all beams. A longer flight keeps every second, fourth, ...
sweep. Chosen."""
FRESH_S = 60.0
"""All hits of this last period are kept, s. Chosen."""
SWEEP_S = 0.05
"""Interval of the sweeps, s."""


class FrameColumn(IntEnum):
    """Columns of a keyframe: motion since the last one in its body frame, and the present pose."""

    TIME_S = 0
    FORWARD_M = 1
    """Displacement by odometry without scale correction."""
    RIGHT_M = 2
    TURNED_RAD = 3
    """Turn by the gyro without bias and scale correction."""
    NORTH_M = 4
    """Present estimate of the pose."""
    EAST_M = 5
    YAW_RAD = 6
    DOWN_M = 7
    POSITION_SIGMA_M = 8
    YAW_SIGMA_RAD = 9
    AUTOPILOT_YAW_RAD = 10
    """Autopilot's turn since take-off, not wrapped; NaN without recent messages."""
    GAP_RAD2 = 11
    """Variance of the turn during gyro gaps."""


class HitColumn(IntEnum):
    """Columns of a hit, relative to its keyframe's position and heading."""

    TIME_S = 0
    BEAM = 1
    """Index in `BEAMS`."""
    FRAME = 2
    FORWARD_M = 3
    """Position of the drone."""
    RIGHT_M = 4
    BEARING_RAD = 5
    """Bearing of the beam relative to the keyframe's heading."""
    DISTANCE_M = 6
    """Distance from the sensor."""
    DOWN_M = 7
    WALL = 8
    """The hit's wall by the present estimate, or `NO_WALL`."""
    LATE_S = 9
    """Time from the last odometry to the measurement: for so long the position is extrapolated."""


class Table:
    """A growing table of numbers."""

    def __init__(self, columns: int) -> None:
        self._rows = np.empty((256, columns))
        self._count = 0

    @classmethod
    def of(cls, rows: Array) -> "Table":
        """A table of the rows (n, columns)."""
        table = cls(rows.shape[1])
        table._rows, table._count = rows.copy(), len(rows)
        return table

    def __len__(self) -> int:
        return self._count

    def append(self, row: Sequence[float]) -> None:
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[self._count] = row
        self._count += 1

    @property
    def rows(self) -> Array:
        """(n, columns): a view, valid until the next change."""
        return self._rows[: self._count]

    def keep(self, kept: Mask) -> None:
        """Keep only the rows of the mask (n,)."""
        left = self.rows[kept]
        self._count = len(left)
        self._rows[: self._count] = left


class FlightRecord:
    """All keyframes and hits of the flight."""

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

    @classmethod
    def of_ended_flight(cls, frames: Array, hits: Array) -> "FlightRecord":
        """A record of keyframes (k, FrameColumn) and hits (n, HitColumn)."""
        record = cls()
        record._frames, record._hits = Table.of(frames), Table.of(hits)
        return record

    @property
    def frames(self) -> Array:
        """(k, FrameColumn): a view."""
        return self._frames.rows

    @property
    def poses(self) -> Array:
        """(k, 3): present estimate of the keyframes, north, east, yaw; a view."""
        return self.frames[:, FrameColumn.NORTH_M : FrameColumn.YAW_RAD + 1]

    @property
    def hits(self) -> Array:
        """(n, HitColumn): a view."""
        return self._hits.rows

    @property
    def raw(self) -> tuple[Vector2, float]:
        """Raw dead-reckoned position and yaw at the last keyframe."""
        return self._raw_ne_m, self._raw_yaw_rad

    def bridge(self, variance_rad2: float) -> None:
        """Add the variance of the turn during a gyro gap."""
        self._gap_rad2 += variance_rad2

    def bridged_since_rad2(self, time_s: float) -> float:
        """Sum of these variances after `time_s`."""
        is_since = self.frames[:, FrameColumn.TIME_S] > time_s
        return float(self.frames[is_since, FrameColumn.GAP_RAD2].sum()) + self._gap_rad2

    def advance(
        self, pose: Pose, raw_ne_m: Vector2, raw_yaw_rad: float, autopilot_yaw_rad: float = math.nan
    ) -> None:
        """Update the motion since the last keyframe; add a keyframe when one is due.

        `raw_ne_m` and `raw_yaw_rad` are uncorrected dead reckoning.
        """
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
        """Add a hit that was read now.

        `measured_at`: displacement (forward, right) from the last odometry to the moment of
        measurement, `late_s` later, and the bearing of the beam then, relative to the heading now.
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
        """Thin the hits to at most `MAX_HITS`, uniformly over the flight."""
        while len(self._hits) > MAX_HITS:
            self._stride *= 2
            time_s = self.hits[:, HitColumn.TIME_S]
            is_fresh = time_s > time_s[-1] - FRESH_S
            self._hits.keep(is_fresh | (np.rint(time_s / SWEEP_S) % self._stride == 0))

    def correct(self, first: int, poses: Array, first_hit: int, wall_of: Indices) -> None:
        """Store corrected poses and walls of hits.

        `poses` (k, 3): north, east, yaw from keyframe `first` on. Later hits get no wall, because
        the walls' indices have changed.
        """
        self.poses[first : first + len(poses)] = poses
        walls = self.hits[first_hit:, HitColumn.WALL]
        walls[: len(wall_of)] = wall_of
        walls[len(wall_of) :] = NO_WALL

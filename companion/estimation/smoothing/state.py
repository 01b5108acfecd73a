"""State of the smoother, and the flight record as its measurements."""

from dataclasses import dataclass, replace

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.core.frames import Vector2
from companion.estimation.smoothing.flight_record import (
    NO_WALL,
    FlightRecord,
    FrameColumn,
    HitColumn,
)
from companion.estimation.smoothing.height_levels import levels
from companion.estimation.smoothing.odometry_model import averaged
from companion.estimation.smoothing.range_noise import BEAMS, RangeUnits

NORTH, EAST, YAW, BIAS, WANDER_NORTH, WANDER_EAST = range(6)
"""Indices in a pose."""
POSE_SIZE = 6
"""Unknowns of a pose."""
WALL_SIZE = 2
"""Unknowns of a wall."""
GYRO_SCALE, ODOMETRY_SCALE, GAINS = range(3)
"""Indices in a flight's calibration; the range units' gains come last."""
CALIBRATION_SIZE = GAINS + len(BEAMS)
"""Unknowns of a flight's calibration."""


@dataclass(slots=True)
class Unknowns:
    """All unknowns; angles in rad, local NED."""

    poses: Array
    """(k, 6): north, east, yaw (not wrapped), gyro bias, wander of the odometry north and east."""
    walls: Array
    """(w, 2): direction of the normal, offset."""
    reach_m: Array
    """(w, 2): interval of each wall's hits along (-sin, cos)(normal)."""
    calibration: Array
    """(f, 2 + beams): scale errors of gyro and odometry, and gain errors of the range units, for
    each flight; positive if an instrument reads too much."""

    @classmethod
    def at(cls, poses: Array, bias_rad_s: float) -> "Unknowns":
        """Poses (k, 3) of one flight, no walls, scales and gains of perfect sensors."""
        count = len(poses)
        x = np.column_stack([poses, np.full(count, bias_rad_s), np.zeros((count, 2))])
        x[:, YAW] = np.unwrap(x[:, YAW])
        return cls(x, np.empty((0, 2)), np.empty((0, 2)), np.zeros((1, CALIBRATION_SIZE)))

    @property
    def gyro_scale(self) -> Array:
        """(f,): relative scale error of the gyro; a view."""
        return self.calibration[:, GYRO_SCALE]

    @property
    def odometry_scale(self) -> Array:
        """(f,): relative scale error of the odometry; a view."""
        return self.calibration[:, ODOMETRY_SCALE]

    @property
    def range_gain(self) -> Array:
        """(f, beams): relative gain error of each range unit; a view."""
        return self.calibration[:, GAINS:]

    @property
    def tracks(self) -> Array:
        """(k, 2): position by the odometry's estimate, north and east."""
        tracks: Array = self.poses[:, :YAW] + self.poses[:, WANDER_NORTH:]
        return tracks

    @property
    def normals(self) -> Array:
        """(w, 2): unit normals, towards the walls."""
        return normals_of(self.walls)

    @property
    def tangents(self) -> Array:
        """(w, 2): unit vectors along the walls, the normal turned clockwise by 90°."""
        return tangents_of(self.walls)

    def since(self, frame: int) -> "Unknowns":
        """A copy from a keyframe of the first flight on."""
        return replace(
            self,
            poses=self.poses[frame:].copy(),
            walls=self.walls.copy(),
            reach_m=self.reach_m.copy(),
            calibration=self.calibration.copy(),
        )

    def add_walls(self, walls: Array, reach_m: Array) -> None:
        """Append walls (w, 2) and their reach (w, 2)."""
        self.walls = np.vstack([self.walls, walls])
        self.reach_m = np.vstack([self.reach_m, reach_m])

    def keep_walls(self, kept: Indices, wall_of: Indices) -> Indices:
        """Keep only these walls. Returns the hits' walls (n,) with new indices, or NO_WALL."""
        number = np.full(len(self.walls) + 1, NO_WALL)
        number[kept] = np.arange(len(kept))
        self.walls, self.reach_m = self.walls[kept], self.reach_m[kept]
        return number[wall_of]


@dataclass(frozen=True, slots=True)
class Measured:
    """The records of flights with k keyframes and n hits, as in `flight_record`.

    The keyframes of one flight follow those of another; hits are in order of keyframes.
    """

    dt_s: Array
    """(k - 1,): time between keyframes, s."""
    age_s: Array
    """(k - 1,): time since the gyro's calibration, s."""
    moved_frd_m: Array
    """(k - 1, 2): displacement by odometry."""
    turned_rad: Array
    """(k - 1,): turn by the gyro."""
    autopilot_yaw_rad: Array
    """(k,): the autopilot's turn since take-off; NaN without a recent message."""
    bias_moved_rad_s: Array
    """(k - 1,): change of the gyro's bias where the autopilot's gyro determines it."""
    is_aided: Mask
    """(k - 1,): True where it does."""
    frame: Indices
    """(n,): keyframe of each hit."""
    beam: Indices
    """(n,): index in `BEAMS`."""
    offset_frd_m: Array
    """(n, 2): position of the drone relative to the keyframe."""
    bearing_rad: Array
    """(n,): bearing relative to the keyframe's heading."""
    distance_m: Array
    """(n,): distance from the sensor."""
    mount_m: Array
    """(n,): distance from the drone's centre to the sensor, along its beam."""
    averaged_frd_m: Array
    """(k - 1, 2): displacements averaged over some seconds, the instrument of the odometry
    scale."""
    gap_rad2: Array | None = None
    """(k - 1,): variance of the turn during gyro gaps; None without any."""
    late_s: Array | None = None
    """(n,): time from the last odometry to the measurement, s; None: zero for all hits."""
    height_m: Array | None = None
    """(n,): height of the drone above its start, m; None: the same for all hits."""
    level: Indices | None = None
    """(n,): level of each hit (`height_levels.py`); None: all at one."""
    begins: tuple[int, ...] = (0,)
    """First keyframe of each flight."""

    @classmethod
    def of(cls, record: FlightRecord, units: RangeUnits) -> "Measured":
        """All measurements recorded so far."""
        frames, hits = record.frames.copy(), record.hits.copy()
        time_s = frames[:, FrameColumn.TIME_S]
        dt_s = np.diff(time_s)
        moved_frd_m = frames[1:, FrameColumn.FORWARD_M : FrameColumn.RIGHT_M + 1]
        turned_rad = frames[1:, FrameColumn.TURNED_RAD]
        beam = hits[:, HitColumn.BEAM].astype(np.int64)
        return cls(
            dt_s=dt_s,
            age_s=time_s[1:] - time_s[:1],
            moved_frd_m=moved_frd_m,
            turned_rad=turned_rad,
            autopilot_yaw_rad=frames[:, FrameColumn.AUTOPILOT_YAW_RAD],
            bias_moved_rad_s=np.zeros_like(dt_s),
            is_aided=np.zeros_like(dt_s, dtype=bool),
            frame=hits[:, HitColumn.FRAME].astype(np.int64),
            beam=beam,
            offset_frd_m=hits[:, HitColumn.FORWARD_M : HitColumn.RIGHT_M + 1],
            bearing_rad=hits[:, HitColumn.BEARING_RAD],
            distance_m=hits[:, HitColumn.DISTANCE_M],
            mount_m=units.offset_m[beam],
            averaged_frd_m=averaged(dt_s, moved_frd_m, turned_rad),
            gap_rad2=frames[1:, FrameColumn.GAP_RAD2],
            late_s=hits[:, HitColumn.LATE_S],
            height_m=-hits[:, HitColumn.DOWN_M],
        ).with_levels()

    @property
    def time_s(self) -> Array:
        """(k,): time of the keyframes since the first, s."""
        return np.concatenate([[0.0], np.cumsum(self.dt_s)])

    @property
    def flight(self) -> Indices:
        """(k,): flight of each keyframe."""
        return np.searchsorted(self.begins, np.arange(len(self.dt_s) + 1), side="right") - 1

    @property
    def hit_flight(self) -> Indices:
        """(n,): flight of each hit."""
        return np.searchsorted(self.begins, self.frame, side="right") - 1

    @property
    def hit_level(self) -> Indices:
        """(n,): level of each hit."""
        return np.zeros_like(self.frame) if self.level is None else self.level

    def with_levels(self) -> "Measured":
        """The same with the levels of all hits."""
        return self if self.height_m is None else replace(self, level=levels(self.height_m))

    @property
    def moves(self) -> Indices:
        """Indices of the motions between keyframes of one flight; no motion leads to the next."""
        return np.delete(np.arange(len(self.dt_s)), np.array(self.begins[1:], dtype=np.int64) - 1)

    def first_hit(self, frame: int) -> int:
        """Index of the first hit of a keyframe or a later one."""
        return int(np.searchsorted(self.frame, frame))

    def with_hits(self, hits: Mask) -> "Measured":
        """The same keyframes with the masked hits (n,) alone."""
        return replace(
            self,
            frame=self.frame[hits],
            beam=self.beam[hits],
            offset_frd_m=self.offset_frd_m[hits],
            bearing_rad=self.bearing_rad[hits],
            distance_m=self.distance_m[hits],
            mount_m=self.mount_m[hits],
            late_s=None if self.late_s is None else self.late_s[hits],
            height_m=None if self.height_m is None else self.height_m[hits],
            level=None if self.level is None else self.level[hits],
        )

    def between(self, first: int, end: int) -> "Measured":
        """The part of one flight from keyframe `first` up to, not including, `end`."""
        low, high = self.first_hit(first), self.first_hit(end)
        motion, hits = slice(first, max(end - 1, first)), slice(low, high)
        return Measured(
            self.dt_s[motion],
            self.age_s[motion],
            self.moved_frd_m[motion],
            self.turned_rad[motion],
            self.autopilot_yaw_rad[first:end],
            self.bias_moved_rad_s[motion],
            self.is_aided[motion],
            self.frame[hits] - first,
            self.beam[hits],
            self.offset_frd_m[hits],
            self.bearing_rad[hits],
            self.distance_m[hits],
            self.mount_m[hits],
            self.averaged_frd_m[motion],
            None if self.gap_rad2 is None else self.gap_rad2[motion],
            None if self.late_s is None else self.late_s[hits],
            None if self.height_m is None else self.height_m[hits],
            None if self.level is None else self.level[hits],
        )


@dataclass(frozen=True, slots=True)
class Rays:
    """The hits placed by the unknowns, local NED."""

    origins: Array
    """(n, 2): position of the drone."""
    beams: Array
    """(n, 2): unit vectors along the beams."""
    points: Array
    """(n, 2): ends of the beams."""
    flight: Indices
    level: Indices
    """(n,): flight and level of each hit."""

    @property
    def bearing_rad(self) -> Array:
        """(n,): bearings of the beams."""
        bearing: Array = np.arctan2(self.beams[:, 1], self.beams[:, 0])
        return bearing


def normals_of(walls: Array) -> Array:
    """(w, 2): unit normals of walls (w, 2), towards them."""
    return np.column_stack([np.cos(walls[:, 0]), np.sin(walls[:, 0])])


def tangents_of(walls: Array) -> Array:
    """(w, 2): unit vectors along walls (w, 2), the normal turned clockwise by 90°."""
    return np.column_stack([-np.sin(walls[:, 0]), np.cos(walls[:, 0])])


def walls_moved_to(start: Array, walls: Array, reach_m: Array) -> tuple[Array, Array]:
    """Walls (w, 2), and their reach, in the frame in which their own begins at `start` (3,)."""
    moved = walls + np.array([start[YAW], 0.0])
    moved[:, 1] += normals_of(moved) @ start[:YAW]
    return moved, reach_m + (tangents_of(moved) @ start[:YAW])[:, None]


def place_on(wall: Array, along_m: float) -> Vector2:
    """North and east of a position on the line of a wall (2,), m."""
    [normal], [tangent] = normals_of(wall[None]), tangents_of(wall[None])
    north_m, east_m = (wall[1] * normal + along_m * tangent).tolist()
    return north_m, east_m


def to_ned(frd_m: Array, yaw_rad: Array) -> Array:
    """(n, 2): forward and right rotated to north and east, each by its heading (n,)."""
    (forward, right), cos, sin = frd_m.T, np.cos(yaw_rad), np.sin(yaw_rad)
    return np.column_stack([cos * forward - sin * right, sin * forward + cos * right])


def project(x: Unknowns, m: Measured) -> Rays:
    """p_hit = p_k + R(ψ_k)·(1 + s)·q + (mount + (1 - γ_beam)·distance)·u(bearing)."""
    yaw, scale = x.poses[m.frame, 2], x.odometry_scale[m.hit_flight, None]
    origins = x.poses[m.frame, :2] + to_ned((1 + scale) * m.offset_frd_m, yaw)
    bearing = yaw + m.bearing_rad
    range_m = m.mount_m + unbiased_m(x, m)
    beams = np.column_stack([np.cos(bearing), np.sin(bearing)])
    return Rays(origins, beams, origins + range_m[:, None] * beams, m.hit_flight, m.hit_level)


def unbiased_m(x: Unknowns, m: Measured) -> Array:
    """(n,): distances without the gain errors of the range units, (1 - γ)·d."""
    distance_m: Array = (1 - x.range_gain[m.hit_flight, m.beam]) * m.distance_m
    return distance_m


def by_odometry_m(x: Unknowns, m: Measured) -> Array:
    """(k - 1, 2): displacement north and east between keyframes by odometry."""
    scale = x.odometry_scale[m.flight[:-1], None]
    return to_ned((1 + scale) * m.moved_frd_m, x.poses[:-1, YAW])


def reach_m(x: Unknowns, points: Array, wall_of: Indices) -> Array:
    """(w, 2): interval of each wall's hits (n, 2) along it; (inf, -inf) without hits."""
    ends = np.tile([np.inf, -np.inf], (len(x.walls), 1))
    on_wall = wall_of >= 0
    along = (points[on_wall] * x.tangents[wall_of[on_wall]]).sum(axis=1)
    np.minimum.at(ends[:, 0], wall_of[on_wall], along)
    np.maximum.at(ends[:, 1], wall_of[on_wall], along)
    return ends


def in_rows(
    x: Unknowns, points: Array, wall: Indices, max_gap_m: float, group: Indices | None = None
) -> tuple[Indices, Array, Mask]:
    """Sort hits (h, 2) on walls (h,) into rows without a larger gap.

    Returns the order by group, wall and position, (h,); the positions along the walls in that
    order; and a mask of the first hits of the rows. `group` (h,): hits of two groups form no row.
    """
    along = (points * x.tangents[wall]).sum(axis=1)
    group = np.zeros_like(wall) if group is None else group
    order = np.lexsort((along, wall, group))
    group, wall, along = group[order], wall[order], along[order]
    is_first = (np.diff(wall, prepend=-1) != 0) | (np.diff(along, prepend=0) > max_gap_m)
    is_first |= np.diff(group, prepend=0) != 0
    return order, along, is_first

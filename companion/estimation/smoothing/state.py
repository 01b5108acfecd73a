"""What the smoother solves for, and the record of the flight as it takes it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from companion.estimation.smoothing.flight_record import (
    NO_WALL,
    FlightRecord,
    FrameColumn,
    HitColumn,
)
from companion.estimation.smoothing.odometry_model import averaged
from companion.estimation.smoothing.range_noise import BEAMS, RangeUnits

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

NORTH, EAST, YAW, BIAS, WANDER_NORTH, WANDER_EAST = range(6)
"""Places in a pose."""
POSE_SIZE = 6
WALL_SIZE = 2


@dataclass(slots=True)
class Unknowns:
    """Everything that is not known exactly; angles in rad, local NED."""

    poses: Array
    """(k, 6): north, east, yaw (not wrapped), gyro bias, wander of the odometry north and east."""
    walls: Array
    """(w, 2): direction of the normal, offset."""
    reach_m: Array
    """(w, 2): from where to where along (-sin, cos)(normal) each wall has been seen."""
    gyro_scale: float
    odometry_scale: float
    range_gain: Array
    """(beams,): how much too far each unit reads, relative."""

    @classmethod
    def at(cls, poses: Array, bias_rad_s: float) -> "Unknowns":
        """Poses (k, 3), no walls yet, scales and gains as if the sensors were perfect."""
        count = len(poses)
        x = np.column_stack([poses, np.full(count, bias_rad_s), np.zeros((count, 2))])
        x[:, YAW] = np.unwrap(x[:, YAW])
        return cls(x, np.empty((0, 2)), np.empty((0, 2)), 0.0, 0.0, np.zeros(len(BEAMS)))

    @property
    def tracks(self) -> Array:
        """(k, 2): where the odometry has the drone, north and east."""
        tracks: Array = self.poses[:, :YAW] + self.poses[:, WANDER_NORTH:]
        return tracks

    @property
    def normals(self) -> Array:
        """(w, 2): unit vectors to the walls."""
        return np.column_stack([np.cos(self.walls[:, 0]), np.sin(self.walls[:, 0])])

    @property
    def tangents(self) -> Array:
        """(w, 2): along each wall, its normal turned clockwise by a right angle."""
        return np.column_stack([-np.sin(self.walls[:, 0]), np.cos(self.walls[:, 0])])

    def since(self, frame: int) -> "Unknowns":
        """A copy from a keyframe on."""
        return replace(
            self,
            poses=self.poses[frame:].copy(),
            walls=self.walls.copy(),
            reach_m=self.reach_m.copy(),
            range_gain=self.range_gain.copy(),
        )

    def add_walls(self, walls: Array, reach_m: Array) -> None:
        """Append (w, 2) and (w, 2)."""
        self.walls = np.vstack([self.walls, walls])
        self.reach_m = np.vstack([self.reach_m, reach_m])

    def keep_walls(self, kept: Indices, wall_of: Indices) -> Indices:
        """Forget all others; the walls of the hits (n,), or NO_WALL, as they are numbered then."""
        number = np.full(len(self.walls) + 1, NO_WALL)
        number[kept] = np.arange(len(kept))
        self.walls, self.reach_m = self.walls[kept], self.reach_m[kept]
        return number[wall_of]


@dataclass(frozen=True, slots=True)
class Measured:
    """The record of k keyframes and n hits, as in `flight_record`; hits in order of keyframes."""

    dt_s: Array
    """(k - 1,)."""
    age_s: Array
    """(k - 1,): since the gyro's calibration."""
    moved_frd_m: Array
    """(k - 1, 2)."""
    turned_rad: Array
    """(k - 1,)."""
    autopilot_yaw_rad: Array
    """(k,): turned since take-off by the autopilot; not a number where it did not tell."""
    bias_moved_rad_s: Array
    """(k - 1,): by how much the gyro's bias has moved, where that is known,"""
    is_steadied: NDArray[np.bool_]
    """(k - 1,): and where that is."""
    frame: Indices
    """(n,): of each hit its keyframe."""
    beam: Indices
    """(n,): its place in `BEAMS`."""
    offset_frd_m: Array
    """(n, 2)."""
    bearing_rad: Array
    """(n,): off the keyframe's heading."""
    distance_m: Array
    """(n,): from the sensor."""
    mount_m: Array
    """(n,): from the drone's centre to the sensor, along its beam."""
    averaged_frd_m: Array
    """(k - 1, 2): displacements averaged over the time around, by which the scale is asked for."""
    gap_rad2: Array | None = None
    """(k - 1,): variance of what was turned while the gyro was silent; None if it never was."""
    late_s: Array | None = None
    """(n,): how long after the last odometry each was measured; None: at its time."""

    @classmethod
    def of(cls, record: FlightRecord, units: RangeUnits) -> "Measured":
        """All that was recorded so far."""
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
            is_steadied=np.zeros_like(dt_s, dtype=bool),
            frame=hits[:, HitColumn.FRAME].astype(np.int64),
            beam=beam,
            offset_frd_m=hits[:, HitColumn.FORWARD_M : HitColumn.RIGHT_M + 1],
            bearing_rad=hits[:, HitColumn.BEARING_RAD],
            distance_m=hits[:, HitColumn.DISTANCE_M],
            mount_m=units.offset_m[beam],
            averaged_frd_m=averaged(dt_s, moved_frd_m, turned_rad),
            gap_rad2=frames[1:, FrameColumn.GAP_RAD2],
            late_s=hits[:, HitColumn.LATE_S],
        )

    @property
    def time_s(self) -> Array:
        """(k,): of the keyframes, since the first."""
        return np.concatenate([[0.0], np.cumsum(self.dt_s)])

    def first_hit(self, frame: int) -> int:
        """Of a keyframe or those after it."""
        return int(np.searchsorted(self.frame, frame))

    def between(self, first: int, end: int) -> "Measured":
        """The part from keyframe `first` up to, not including, `end`."""
        low, high = self.first_hit(first), self.first_hit(end)
        motion, hits = slice(first, max(end - 1, first)), slice(low, high)
        return Measured(
            self.dt_s[motion],
            self.age_s[motion],
            self.moved_frd_m[motion],
            self.turned_rad[motion],
            self.autopilot_yaw_rad[first:end],
            self.bias_moved_rad_s[motion],
            self.is_steadied[motion],
            self.frame[hits] - first,
            self.beam[hits],
            self.offset_frd_m[hits],
            self.bearing_rad[hits],
            self.distance_m[hits],
            self.mount_m[hits],
            self.averaged_frd_m[motion],
            None if self.gap_rad2 is None else self.gap_rad2[motion],
            None if self.late_s is None else self.late_s[hits],
        )


@dataclass(frozen=True, slots=True)
class Sightings:
    """The hits as the unknowns place them, local NED."""

    eyes: Array
    """(n, 2): where the drone was."""
    beams: Array
    """(n, 2): unit vectors along the beams."""
    points: Array
    """(n, 2): where the beams ended."""

    @property
    def bearing_rad(self) -> Array:
        """(n,): of the beams."""
        bearing: Array = np.arctan2(self.beams[:, 1], self.beams[:, 0])
        return bearing


def to_ned(frd_m: Array, yaw_rad: Array) -> Array:
    """(n, 2): forward and right turned into north and east, each by its own heading (n,)."""
    (forward, right), cos, sin = frd_m.T, np.cos(yaw_rad), np.sin(yaw_rad)
    return np.column_stack([cos * forward - sin * right, sin * forward + cos * right])


def project(x: Unknowns, m: Measured) -> Sightings:
    """p_hit = p_k + R(ψ_k)·(1 + s)·q + (mount + (1 - γ_beam)·distance)·u(bearing)."""
    yaw = x.poses[m.frame, 2]
    eyes = x.poses[m.frame, :2] + to_ned((1 + x.odometry_scale) * m.offset_frd_m, yaw)
    bearing = yaw + m.bearing_rad
    range_m = m.mount_m + (1 - x.range_gain[m.beam]) * m.distance_m
    beams = np.column_stack([np.cos(bearing), np.sin(bearing)])
    return Sightings(eyes, beams, eyes + range_m[:, None] * beams)


def reach_m(x: Unknowns, points: Array, wall_of: Indices) -> Array:
    """(w, 2): the first and last along each wall of its hits (n, 2); (inf, -inf) if it has none."""
    ends = np.tile([np.inf, -np.inf], (len(x.walls), 1))
    mine = wall_of >= 0
    along = (points[mine] * x.tangents[wall_of[mine]]).sum(axis=1)
    np.minimum.at(ends[:, 0], wall_of[mine], along)
    np.maximum.at(ends[:, 1], wall_of[mine], along)
    return ends


def in_rows(
    x: Unknowns, points: Array, wall: Indices, largest_gap_m: float
) -> tuple[Indices, Array, NDArray[np.bool_]]:
    """Hits (h, 2) on walls (h,) put in rows without a larger gap between neighbours.

    The order by wall and along it, (h,); where along it they are, in that order; and which begin
    a row, likewise.
    """
    along = (points * x.tangents[wall]).sum(axis=1)
    order = np.lexsort((along, wall))
    wall, along = wall[order], along[order]
    is_first = (np.diff(wall, prepend=-1) != 0) | (np.diff(along, prepend=0) > largest_gap_m)
    return order, along, is_first

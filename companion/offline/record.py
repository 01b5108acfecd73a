"""Converts a log's rows to the smoother's measurements, and keyframe poses back to rows."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Indices, Mask
from companion.core.messages import Beam
from companion.estimation.smoothing.odometry_model import averaged
from companion.estimation.smoothing.range_noise import BEAMS
from companion.estimation.smoothing.state import Measured
from companion.offline.ranges import HorizontalBeam
from companion.offline.reading.log import Log

KEYFRAME_PERIOD_S = 0.2
"""Interval of the keyframes, s. Chosen."""
MAX_KEYFRAMES = 5_000
"""Most keyframes; a longer log gets a longer interval. Chosen."""
MAX_HITS = 20_000
"""Most hits; of a longer log only every n-th row is used. Chosen: with four times as many hits a
map of ten minutes at 50 Hz is no better, and takes 75 s instead of 45."""
MAX_SPEED_M_S = 5.0
LONGEST_STEP_M = 1.5
"""A longer and faster odometry step is a jump of the estimate, not motion; m/s, m. Chosen."""
YAW_JUMP_RAD = math.radians(8)
GYRO_HOLDS_S = 0.5
"""A turn between rows at most this far apart, s, that differs from the gyro's by more than this,
rad, is a jump of the yaw. Chosen."""
MAX_DT_S = 30.0
"""A longer gap counts as this long, s. Chosen: otherwise the gyro's bias would appear to be known
too exactly."""


@dataclass(frozen=True, slots=True)
class Record:
    """A log as measurements of the smoother."""

    measured: Measured
    rows: Indices
    """(k,): row of each keyframe."""
    hit_rows: Indices
    """(n,): row of each hit."""
    motion: Array
    """(rows, 3): odometry without its jumps."""
    jumps: int


def to_record(log: Log, beams: Mapping[Beam, HorizontalBeam]) -> Record:
    """Select keyframes, and store each hit relative to the preceding one."""
    motion, jumps = _without_jumps(log)
    since_s = log.time_s - log.time_s[0]
    period_s = max(KEYFRAME_PERIOD_S, float(since_s[-1]) / MAX_KEYFRAMES)
    _, rows = np.unique(np.floor(since_s / period_s + 1e-6), return_index=True)
    frame_of = np.searchsorted(rows, np.arange(len(since_s)), side="right") - 1
    step = max(1, math.ceil(len(since_s) * len(beams) / MAX_HITS))
    used = np.zeros(len(since_s), dtype=bool)
    used[::step] = True
    hit_row, beam_of = _hits(beams, used)
    since = relative(motion[rows[frame_of]], motion)
    bearing, distance_m, mount_m = (np.zeros(len(hit_row)) for _ in range(3))
    for beam, one in beams.items():
        of_beam = beam_of == BEAMS.index(beam)
        bearing[of_beam] = since[hit_row[of_beam], 2] + one.bearing_frd_rad
        distance_m[of_beam] = one.range_m[hit_row[of_beam]]
        mount_m[of_beam] = one.offset_m
    moved = relative(motion[rows[:-1]], motion[rows[1:]])
    dt_s = np.minimum(np.diff(log.time_s[rows]), MAX_DT_S)
    measured = Measured(
        dt_s=dt_s,
        age_s=np.cumsum(dt_s),
        moved_frd_m=moved[:, :2],
        turned_rad=moved[:, 2],
        autopilot_yaw_rad=np.full(len(rows), np.nan),
        bias_moved_rad_s=np.zeros_like(dt_s),
        is_aided=np.zeros_like(dt_s, dtype=bool),
        frame=frame_of[hit_row],
        beam=beam_of,
        offset_frd_m=since[hit_row, :2],
        bearing_rad=bearing,
        distance_m=distance_m,
        mount_m=mount_m,
        averaged_frd_m=averaged(dt_s, moved[:, :2], moved[:, 2]),
    )
    return Record(measured, rows, hit_row, motion, jumps)


def _hits(beams: Mapping[Beam, HorizontalBeam], used: Mask) -> tuple[Indices, Indices]:
    """Row and beam number of each hit, in order of rows."""
    row = [np.flatnonzero(np.isfinite(beam.range_m) & used) for beam in beams.values()]
    number = [np.full(len(r), BEAMS.index(beam)) for beam, r in zip(beams, row, strict=True)]
    if not row:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    rows, numbers = np.concatenate(row), np.concatenate(number)
    order = np.argsort(rows, kind="stable")
    return rows[order], numbers[order]


def _without_jumps(log: Log) -> tuple[Array, int]:
    """Odometry (n, 3) with its jumps removed, and their number."""
    steps, dt_s = np.diff(log.odometry, axis=0), np.diff(log.time_s)
    length = np.hypot(steps[:, 0], steps[:, 1])
    jump = length > np.maximum(LONGEST_STEP_M, MAX_SPEED_M_S * dt_s)
    steps[jump, :2] = 0.0
    if log.gyro_rad_s is not None:
        turned = 0.5 * (log.gyro_rad_s[1:] + log.gyro_rad_s[:-1]) * dt_s
        known = np.isfinite(turned) & (dt_s < GYRO_HOLDS_S)
        slack_rad = YAW_JUMP_RAD + 0.5 * np.abs(turned)
        yaw_jump = known & (np.abs(steps[:, 2] - turned) > slack_rad)
        steps[yaw_jump, 2] = turned[yaw_jump]
        jump |= yaw_jump
    if not jump.any():
        return log.odometry, 0
    motion: Array = log.odometry[0] + np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    return motion, int(jump.sum())


def relative(start: Array, end: Array) -> Array:
    """Poses (n, 3) relative to others (n, 3): forward, right, turn."""
    north, east, turn = (end - start).T
    cos, sin = np.cos(start[:, 2]), np.sin(start[:, 2])
    return np.column_stack([cos * north + sin * east, cos * east - sin * north, turn])


def poses_of_rows(record: Record, poses: Array) -> Array:
    """Poses (rows, 3) between keyframes (k, 3): by odometry, with its residuals spread evenly."""
    count = len(record.motion)
    frame = np.searchsorted(record.rows, np.arange(count), side="right") - 1
    first = record.motion[record.rows[frame]]
    carried = _moved(poses[frame], relative(first, record.motion))
    after = np.minimum(frame + 1, len(record.rows) - 1)
    there = relative(first, record.motion[record.rows[after]])
    misfit = poses[after] - _moved(poses[frame], there)
    rows_between = np.maximum(record.rows[after] - record.rows[frame], 1)
    share = (np.arange(count) - record.rows[frame]) / rows_between
    share = np.where(after > frame, share, 0.0)
    rows: Array = carried + share[:, None] * misfit
    return rows


def _moved(poses: Array, motion_frd: Array) -> Array:
    forward, right, turn = motion_frd.T
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    moved: Array = np.column_stack([cos * forward - sin * right, sin * forward + cos * right, turn])
    return poses + moved

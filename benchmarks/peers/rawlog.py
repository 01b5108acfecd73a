"""Writes a flight as a rawlog of MRPT: pairs of a movement by odometry, and a scan.

Others read CARMEN logs, and so does MRPT. But its converter (2.5.8) marks the ranges that are valid
as invalid, and gives all scans one time. A rawlog is a compressed sequence of objects, each with
its class, a version of its format, and an end flag. MRPT's axes are x ahead, y to the left, angles
counter-clockwise; ours are north, east, clockwise.
"""

import gzip
import math
from pathlib import Path
from struct import pack

import numpy as np

from benchmarks.peers.flight import LIDAR_SIGMA_M
from companion.core.arrays import Array
from companion.core.messages import Beam
from companion.estimation.smoothing.range_noise import BEAMS

END = b"\x88"
EPOCH_TICKS = 132_000_000_000_000_000
"""Begin of the flight in MRPT's time, 0.1 µs since 1601: in April 2019."""
ODOMETRY, GAUSSIAN = 0, 0
"""MRPT's numbers of the source of a movement, and of the model of its noise."""
NOISE = 0.01, math.degrees(0.001), math.radians(1.0), 0.05, 0.01, math.radians(0.2)
"""MRPT's default noise of odometry, which fits a drone's optical flow: 1 % and 1 cm a step."""
SAMPLES = 300, 0.05, math.radians(4), 0.01, math.degrees(0.0001), 0.001, math.radians(0.05)
"""MRPT's defaults of its other noise model, which is not used."""


def write_lidar(path: Path, times_s: Array, odometry: Array, lidar_m: Array, max_m: float) -> None:
    """Write scans (k, 360), clockwise from the nose, with poses by odometry (k, 3)."""
    count = lidar_m.shape[1]
    order = [(count // 2 - number) % count for number in range(count)]
    _write(path, times_s, odometry, lidar_m[:, order], max_m)


def write_beams(path: Path, times_s: Array, odometry: Array, beams_m: Array, max_m: float) -> None:
    """Write our level beams, of all in (k, `BEAMS`), as scans of four ranges."""
    order = [BEAMS.index(beam) for beam in (Beam.BACK, Beam.RIGHT, Beam.FRONT, Beam.LEFT)]
    _write(path, times_s, odometry, beams_m[:, order], max_m)


def _write(path: Path, times_s: Array, odometry: Array, ranges_m: Array, max_m: float) -> None:
    """Write scans (k, n) from behind, counter-clockwise round to just before behind."""
    ticks = EPOCH_TICKS + np.round(1e7 * times_s).astype(np.int64)
    moves = _moves(odometry)
    with gzip.open(path, "wb", compresslevel=1) as file:
        for tick, move, ranges in zip(ticks.tolist(), moves.tolist(), ranges_m, strict=True):
            file.write(_object("obs::CActionCollection", 0, pack("<I", 1) + _movement(move, tick)))
            scan = _scan(ranges, max_m, tick)
            file.write(_object("obs::CSensoryFrame", 2, pack("<I", 1) + scan))


def _moves(odometry: Array) -> Array:
    """(k, 3): movement ahead, to the left, and turn to the left since the pose before."""
    poses = odometry * (1, -1, -1)
    steps = np.diff(poses, axis=0, prepend=poses[:1])
    before_rad = np.concatenate([poses[:1, 2], poses[:-1, 2]])
    cos, sin = np.cos(before_rad), np.sin(before_rad)
    ahead_m = cos * steps[:, 0] + sin * steps[:, 1]
    left_m = cos * steps[:, 1] - sin * steps[:, 0]
    return np.column_stack([ahead_m, left_m, steps[:, 2]])


def _movement(move: list[float], tick: int) -> bytes:
    pose = _object("poses::CPose2D", 1, pack("<3d", *move))
    noise = pack("<I6f", GAUSSIAN, *NOISE) + pack("<I6f", *SAMPLES)
    no_velocities, no_encoders = pack("<?2f", False, 0, 0), pack("<?2i", False, 0, 0)
    content = pack("<I", ODOMETRY) + pose + noise + no_velocities + no_encoders + pack("<Q", tick)
    return _object("obs::CActionRobotMovement2D", 6, content)


def _scan(ranges_m: Array, max_m: float, tick: int) -> bytes:
    count, is_valid = len(ranges_m), np.isfinite(ranges_m)
    view_rad = math.tau * (count - 1) / count
    # the first ray points behind, so the middle of the view is turned from the nose by half a step
    turned_rad = -math.pi / count
    cos, sin = math.cos(turned_rad), math.sin(turned_rad)
    sensor = pack("<3d", 0, 0, 0) + pack("<9d", cos, -sin, 0, sin, cos, 0, 0, 0, 1)
    return _object(
        "obs::CObservation2DRangeScan",
        7,
        pack("<f?f", view_rad, True, max_m)
        + _object("poses::CPose3D", 3, sensor)
        + pack("<I", count)
        + np.where(is_valid, ranges_m, max_m).astype("<f4").tobytes()
        + is_valid.astype(np.uint8).tobytes()
        + pack("<fQf", LIDAR_SIGMA_M, tick, 0.0)
        + pack("<I", 0)  # no label
        + pack("<d?", 0.0, False),
    )


def _object(name: str, version: int, content: bytes) -> bytes:
    known = f"mrpt::{name}".encode()
    return bytes([len(known) | 0x80]) + known + bytes([version]) + content + END

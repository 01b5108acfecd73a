"""Cuts CARMEN logs down to a cheap robot's: `python -m benchmarks.mapping.carmen LOG ... --out D`.

Of the laser only the beams to the front, left and right are left, up to 5.5 m. The path of the log
becomes the reference. For each log it writes two logs for `companion map`: NAME.csv with the wheel
odometry of the log, and NAME_noisy.csv with the path plus the noise of wheel odometry. `--seconds`
limits their length. Then `python -m benchmarks.mapping.logs DIR` prints their table.

The logs are corrected ones: after each scan the ODOM lines go on from the corrected pose of that
scan. Only the motion between a scan and the last ODOM line before the next is the wheels' own; the
odometry here is the sum of these motions.
"""

import argparse
import gzip
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.mapping.offline_logs import Log, write_csv
from companion.core.arrays import Array
from companion.core.messages import Beam
from companion.offline.files import path_tum
from companion.offline.record import relative

MAX_M = 5.5
"""Range of the cheap sensors, m: that of a GP2Y0A710K0F."""
BEARINGS_DEG = {Beam.FRONT: 0, Beam.LEFT: 90, Beam.RIGHT: -90}
"""Bearing of each beam in the laser's frame, counter-clockwise."""
TO_NED = np.array([1.0, -1.0, -1.0])
"""Signs of x, y and heading: CARMEN has y to the left, and turns counter-clockwise."""
SCALE_SIGMA, STEP_M_PER_SQRT_M, TURN_DEG_PER_SQRT_M, TURN_SHARE = 0.02, 0.01, 1.0, 0.02
"""Noise of the odometry: of its scale; of a step, m, and of a heading, degrees, for each square
root of a metre; of a turn, as a share of it. Chosen: that of a wheeled robot on a hard floor."""


def read(path: Path, seconds: float) -> Log:
    """Read the FLASER and ODOM lines of a log, which may be compressed; the path is the truth."""
    content = path.read_bytes()
    text = (gzip.decompress(content) if path.suffix == ".gz" else content).decode()
    scans: list[list[float]] = []
    predicted = [0.0, 0.0, 0.0]
    for line in text.splitlines():
        kind, *fields = line.split() or [""]
        if kind == "ODOM":
            predicted = [float(each) for each in fields[:3]]
        elif kind == "FLASER":
            beams = int(fields[0])
            ranges = [float(each) for each in fields[1 : 1 + beams]]
            pose = [float(each) for each in fields[1 + beams : 4 + beams]]
            time_s = float(fields[1 + beams + 6])
            scans.append([time_s, *pose, *predicted, *_cut_down(ranges)])
            predicted = pose
    rows = np.array(scans)
    odometry = _wheel_odometry(rows[:, 1:4] * TO_NED, rows[:, 4:7] * TO_NED)
    is_later = np.diff(rows[:, 0], prepend=-np.inf) > 0
    is_kept = is_later & (rows[:, 0] - rows[0, 0] <= seconds)
    ranges_m = dict(zip(BEARINGS_DEG, rows[is_kept, 7:].T, strict=True))
    return Log(rows[is_kept, 0], odometry[is_kept], ranges_m, rows[is_kept, 1:4] * TO_NED)


def _wheel_odometry(corrected: Array, predicted: Array) -> Array:
    """(n, 3): the motions from each corrected pose to the next predicted one, (n, 3) each, summed.

    It begins at the first predicted pose.
    """
    *moved_frd_m, turned = relative(corrected[:-1], predicted[1:]).T
    steps = moved_frd_m[0] + 1j * moved_frd_m[1]
    yaw = predicted[0, 2] + np.concatenate([[0.0], np.cumsum(turned)])
    moved = np.concatenate([[predicted[0, :2] @ [1, 1j]], steps * np.exp(1j * yaw[:-1])])
    place = np.cumsum(moved)
    return np.column_stack([place.real, place.imag, yaw])


def _cut_down(ranges_m: list[float]) -> list[float]:
    """The beams of `BEARINGS_DEG` of a scan over 180°, which begins on the right."""
    per_deg = (len(ranges_m) - len(ranges_m) % 2) / 180
    numbers = (round((bearing + 90) * per_deg) for bearing in BEARINGS_DEG.values())
    beams_m = (ranges_m[min(number, len(ranges_m) - 1)] for number in numbers)
    return [distance_m if 0 < distance_m < MAX_M else math.nan for distance_m in beams_m]


def with_noise(path: Array, seed: int = 1) -> Array:
    """(n, 3): odometry of a robot that drives the path."""
    rng = np.random.default_rng(seed)
    yaw = np.unwrap(path[:, 2])
    moved = np.diff(path[:, :2], axis=0) @ [1, 1j] * np.exp(-1j * yaw[:-1])
    root_m, turned = np.sqrt(np.abs(moved)), np.diff(yaw)
    moved = moved * (1 + rng.normal(0, SCALE_SIGMA))
    moved += STEP_M_PER_SQRT_M * root_m * (rng.normal(size=(len(moved), 2)) @ [1, 1j])
    turn_sigma = math.radians(TURN_DEG_PER_SQRT_M) * root_m + TURN_SHARE * np.abs(turned)
    heading = yaw[0] + np.concatenate([[0.0], np.cumsum(turned + rng.normal(0, turn_sigma))])
    place = np.concatenate([[0], np.cumsum(moved * np.exp(1j * heading[:-1]))])
    return np.column_stack([path[0, 0] + place.real, path[0, 1] + place.imag, heading])


def write(log: Log, path: Path) -> None:
    """Write a log for `companion map`, and the reference beside it."""
    write_csv(log, path)
    reference = path.with_name(f"{path.stem}.reference.tum")
    reference.write_text(path_tum(log.time_s, log.truth))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", nargs="+", type=Path, help="CARMEN logs, may be compressed")
    parser.add_argument("--out", type=Path, required=True, help="folder for the logs")
    parser.add_argument("--seconds", type=float, default=math.inf, help="length of each log")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    for source in given.logs:
        log = read(source, given.seconds)
        name = source.name.split(".")[0].removesuffix("-corrected").replace("-", "_")
        write(log, given.out / f"{name}.csv")
        write(replace(log, odometry=with_noise(log.truth)), given.out / f"{name}_noisy.csv")


if __name__ == "__main__":
    main()

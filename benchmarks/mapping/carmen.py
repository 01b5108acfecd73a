"""Cuts CARMEN logs down to a cheap robot's: `python -m benchmarks.mapping.carmen LOG ... --out D`.

Of the laser only the beams to the front, left and right are left, up to 5.5 m. The path of the log
becomes the reference. For each log it writes two logs for `companion map`: NAME.csv with the
odometry of the log, and NAME_noisy.csv with the path plus the noise of wheel odometry. `--seconds`
limits their length. Then `python -m benchmarks.mapping.logs DIR` prints their table.
"""

import argparse
import csv
import gzip
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import wrap_rad

MAX_M = 5.5
"""Range of the cheap sensors, m: that of a GP2Y0A710K0F."""
BEARINGS_DEG = {"front_m": 0, "left_m": 90, "right_m": -90}
"""Bearing of each beam in the laser's frame, counter-clockwise."""
SCALE_SIGMA, STEP_M_PER_SQRT_M, TURN_DEG_PER_SQRT_M, TURN_SHARE = 0.02, 0.01, 1.0, 0.02
"""Noise of the odometry: of its scale; of a step, m, and of a heading, degrees, for each square
root of a metre; of a turn, as a share of it. Chosen: that of a wheeled robot on a hard floor."""
HEADER = "time_s", "odom_x_m", "odom_y_m", "odom_yaw_rad", *BEARINGS_DEG


@dataclass(frozen=True, slots=True)
class LaserLog:
    """Scans of one log, in NED: yaw clockwise."""

    time_s: Array
    path: Array
    """(n, 3): north, east, yaw."""
    odometry: Array
    """(n, 3): the same by the last odometry before each scan."""
    ranges_m: Array
    """(n, 3): of each beam; NaN beyond `MAX_M`."""


def read(path: Path) -> LaserLog:
    """Read the FLASER and ODOM lines of a log, which may be compressed."""
    content = path.read_bytes()
    text = (gzip.decompress(content) if path.suffix == ".gz" else content).decode()
    scans, odometry = [], [0.0, 0.0, 0.0]
    for line in text.splitlines():
        kind, *fields = line.split() or [""]
        if kind == "ODOM":
            odometry = [float(each) for each in fields[:3]]
        elif kind == "FLASER":
            beams = int(fields[0])
            ranges = [float(each) for each in fields[1 : 1 + beams]]
            pose = [float(each) for each in fields[1 + beams : 4 + beams]]
            time_s = float(fields[1 + beams + 6])
            scans.append((time_s, *pose, *odometry, *_cut_down(ranges)))
    rows = np.array(scans)
    rows = rows[np.diff(rows[:, 0], prepend=-np.inf) > 0]
    ned = np.array([1.0, -1.0, -1.0])
    return LaserLog(rows[:, 0], rows[:, 1:4] * ned, rows[:, 4:7] * ned, rows[:, 7:])


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


def write(log: LaserLog, odometry: Array, path: Path) -> None:
    """Write a log for `companion map`, and the reference beside it."""
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(HEADER)
        for time_s, (x_m, y_m, yaw_rad), ranges_m in zip(
            log.time_s.tolist(), odometry.tolist(), log.ranges_m.tolist(), strict=True
        ):
            beams = ("" if math.isnan(each) else f"{each:.3f}" for each in ranges_m)
            place = f"{x_m:.5f}", f"{y_m:.5f}", f"{wrap_rad(yaw_rad):.6f}"
            rows.writerow((f"{time_s:.6f}", *place, *beams))
    lines = (
        f"{time_s:.6f} {north_m:.5f} {east_m:.5f} 0 0 0 "
        f"{math.sin(yaw_rad / 2):.6f} {math.cos(yaw_rad / 2):.6f}\n"
        for time_s, (north_m, east_m, yaw_rad) in zip(
            log.time_s.tolist(), log.path.tolist(), strict=True
        )
    )
    path.with_name(f"{path.stem}.reference.tum").write_text("".join(lines))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", nargs="+", type=Path, help="CARMEN logs, may be compressed")
    parser.add_argument("--out", type=Path, required=True, help="folder for the logs")
    parser.add_argument("--seconds", type=float, default=math.inf, help="length of each log")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    for source in given.logs:
        whole = read(source)
        rows = whole.time_s - whole.time_s[0] <= given.seconds
        log = LaserLog(
            whole.time_s[rows], whole.path[rows], whole.odometry[rows], whole.ranges_m[rows]
        )
        name = source.name.split(".")[0].removesuffix("-corrected").replace("-", "_")
        write(log, log.odometry, given.out / f"{name}.csv")
        write(log, with_noise(log.path), given.out / f"{name}_noisy.csv")


if __name__ == "__main__":
    main()

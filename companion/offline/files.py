"""Files of `companion map` besides the map: trajectory and report."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np

from companion.core.arrays import Array
from companion.core.messages import FloorPlan, WallSegment
from companion.export.map_files import each_by_itself, save, save_as
from companion.offline.mapper import LogMap
from companion.offline.reading.log import Reading
from companion.offline.verdict import Agreement

Report = dict[str, object]


def save_results(result: LogMap, stretches: Sequence[LogMap], folder: Path) -> list[Path]:
    """Write map.json, map.png, map.ply, trajectory.tum and report.json; returns their paths.

    The same files of each stretch go into a folder of its own, `stretch_1` and so on.

    Raises:
        OutputError: names the files that cannot be written; all others are written.
    """
    files: list[Path] = []
    each_by_itself(
        (
            partial(_save_one, result, stretches, folder, files),
            *(
                partial(_save_one, each, (), folder / stretch_name(number), files)
                for number, each in enumerate(stretches, start=1)
            ),
        )
    )
    return files


def stretch_name(number: int) -> str:
    """Name of the folder of a stretch, counted from 1."""
    return f"stretch_{number}"


def _save_one(result: LogMap, stretches: Sequence[LogMap], folder: Path, files: list[Path]) -> None:
    texts = {
        "trajectory.tum": trajectory_tum(result),
        "report.json": report_json(result, stretches),
    }

    def save_text(name: str) -> None:
        save_as(
            lambda text, path: path.write_text(text, encoding="utf-8"), texts[name], folder / name
        )
        files.append(folder / name)

    each_by_itself(
        (
            lambda: files.extend(save(result.plan, folder)),
            *(partial(save_text, name) for name in texts),
        )
    )


def report_json(result: LogMap, stretches: Sequence[LogMap] = ()) -> str:
    """The report as JSON; `stretches`: those that hold, if the whole does not."""
    found = {**report(result), "stretches": [_stretch(*each) for each in enumerate(stretches, 1)]}
    return json.dumps(found, indent=1, allow_nan=False)


def _stretch(number: int, result: LogMap) -> Report:
    return {
        "folder": stretch_name(number),
        "from_s": float(result.log.time_s[0]),
        "to_s": float(result.log.time_s[-1]),
        "reason": result.verdict.reason,
    }


def trajectory_tum(result: LogMap) -> str:
    """The trajectory of a map as by `path_tum`."""
    return path_tum(result.log.time_s, result.path)


def path_tum(time_s: Array, path: Array) -> str:
    """One line per row of a path (n, 3): time x y z qx qy qz qw, in its own NED frame."""
    half = path[:, 2] / 2
    zero = np.zeros(len(half))
    columns = (*path[:, :2].T, zero, zero, zero, np.sin(half), np.cos(half))
    rows = zip(time_s.tolist(), *(column.tolist() for column in columns), strict=True)
    return "".join(
        f"{at_s:.6f} {x:.4f} {y:.4f} {z:.4f} {qx:.6f} {qy:.6f} {qz:.6f} {qw:.6f}\n"
        for at_s, x, y, z, qx, qy, qz, qw in rows
    )


def report(result: LogMap) -> Report:
    """Report on how the log was read and how consistent the map is."""
    log = result.log
    return {
        "verdict": result.verdict.word,
        "reason": result.verdict.reason,
        "better_than_odometry": result.verdict.better_than_odometry,
        "expected_error_m": result.verdict.expected_error_m,
        "rows": _rows(log.reading, len(log.time_s)),
        "odometry_jumps": result.jumps,
        "duration_s": float(log.time_s[-1] - log.time_s[0]),
        "path_length_m": _length_m(result.path),
        "odometry_length_m": _length_m(log.odometry),
        "correction": _correction(result),
        "agreement": _agreement(result.agreement),
        "agreement_of_odometry": _agreement(result.odometry_agreement),
        "walls": [_wall(wall) for wall in result.plan.walls],
        "walls_length_m": walls_length_m(result.plan),
        "ceiling_m": result.plan.ceiling_m,
    }


def walls_length_m(plan: FloorPlan) -> float:
    return sum(wall.length_m for wall in plan.walls)


def _rows(reading: Reading, used: int) -> Report:
    return {
        "read": reading.rows,
        "used": used,
        "skipped": {reason: asdict(entry) for reason, entry in reading.rows_skipped.items()},
        "ranges_skipped": {
            reason: asdict(entry) for reason, entry in reading.cells_skipped.items()
        },
        "out_of_order": reading.rows_sorted,
        "columns_ignored": list(reading.columns_ignored),
    }


def _length_m(path: Array) -> float:
    return float(np.hypot(*np.diff(path[:, :2], axis=0).T).sum())


def _correction(result: LogMap) -> Report:
    """Differences between trajectory and odometry, and the estimated scale errors."""
    difference = result.path - result.log.odometry
    distance_m = np.hypot(difference[:, 0], difference[:, 1])
    return {
        "mean_m": float(distance_m.mean()),
        "max_m": float(distance_m.max()),
        "max_yaw_deg": math.degrees(float(np.abs(difference[:, 2]).max())),
        "odometry_scale_error": result.odometry_scale_error if result.verdict.trusted else None,
        "gyro_scale_error": result.gyro_scale_error if result.verdict.trusted else None,
    }


def _agreement(agreement: Agreement) -> Report:
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in asdict(agreement).items()
    }


def _wall(wall: WallSegment) -> Report:
    return {
        "start_ne_m": wall.start_ne_m,
        "end_ne_m": wall.end_ne_m,
        "length_m": wall.length_m,
        "sigma_m": wall.sigma_m,
        "hits": wall.hits,
    }

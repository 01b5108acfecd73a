"""Maps real robots' logs: `python -m benchmarks.mapping.logs [FOLDER]`.

For each NAME.csv in the folder (default `../shared/logs` beside the checkout) it prints the verdict
of `companion map`, and the error that it expects of the trajectory. If there is a
NAME.reference.tum or NAME.truth.tum, it also prints the ATE of the log's odometry and of the output
trajectory. Prints the table of real logs in docs/offline.md. ATE as by
`evo_ape tum REFERENCE trajectory.tum -a --t_max_diff 0.02`.
"""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from evo.core import metrics, sync
from evo.core.trajectory import PoseTrajectory3D
from evo.tools import file_interface

from companion.core.errors import LogError
from companion.offline.files import trajectory_tum
from companion.offline.mapper import LogMap, map_log
from companion.offline.reading import sensors
from companion.offline.reading.log import Log, ignore
from companion.offline.reading.readers import READERS, read_log

LOGS_FOLDER = Path(__file__).parents[3] / "shared" / "logs"
REFERENCES = ".reference.tum", ".truth.tum"
MAX_APART_S = 0.02
"""Largest time between a row and the compared pose of the reference, s."""
HEADER = (
    "log",
    "rows",
    "seconds",
    "verdict",
    "expected error",
    "ATE of odometry",
    "of what is handed out",
    "CPU",
)


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of one log; ATE in m, None without a reference."""

    result: LogMap
    ate_odometry_m: float | None
    ate_m: float | None
    cpu_s: float


def outcome(path: Path) -> Outcome:
    """Map a log, and compare it with the trajectory beside it.

    Raises:
        LogError: the log is rejected.
    """
    start_s = time.process_time()
    result = map_log(read_log(path, ignore), sensors.load(None, path), ignore)
    cpu_s = time.process_time() - start_s
    reference = _reference_of(path)
    if reference is None:
        return Outcome(result, None, None, cpu_s)
    true = file_interface.read_tum_trajectory_file(str(reference))
    odometry, handed_out = _odometry(result.log), _handed_out(result)
    return Outcome(result, _ate_m(true, odometry), _ate_m(true, handed_out), cpu_s)


def logs_in(folder: Path) -> list[Path]:
    """Logs in a folder, by name."""
    return sorted(path for path in folder.iterdir() if path.name.lower().endswith(tuple(READERS)))


def row(path: Path) -> str:
    name = _name(path)
    try:
        found = outcome(path)
    except LogError as refused:
        return _cells(name, "", "", f"refused: {_reason(refused, path)}", "", "", "", "")
    time_s, verdict = found.result.log.time_s, found.result.verdict
    ates = (found.ate_odometry_m, found.ate_m)
    return _cells(
        name,
        str(len(time_s)),
        f"{time_s[-1] - time_s[0]:.0f}",
        verdict.word,
        f"{verdict.expected_error_m:.2f} m",
        *("" if ate_m is None else f"{ate_m:.2f} m" for ate_m in ates),
        f"{found.cpu_s:.0f} s",
    )


def _reason(refused: LogError, path: Path) -> str:
    return str(refused).removeprefix(f"{path}: ")


def _cells(*cells: str) -> str:
    return "| " + " | ".join(cells) + " |"


def _name(path: Path) -> str:
    return path.name.split(".")[0]


def _reference_of(log: Path) -> Path | None:
    beside = (log.with_name(_name(log) + end) for end in REFERENCES)
    return next((path for path in beside if path.is_file()), None)


def _handed_out(result: LogMap) -> PoseTrajectory3D:
    """The trajectory, read back from the file that the command writes."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "trajectory.tum"
        path.write_text(trajectory_tum(result))
        return file_interface.read_tum_trajectory_file(str(path))


def _odometry(log: Log) -> PoseTrajectory3D:
    half_rad, zero = log.odometry[:, 2] / 2, np.zeros(len(log.time_s))
    return PoseTrajectory3D(
        np.column_stack([log.odometry[:, :2], zero]),
        np.column_stack([np.cos(half_rad), zero, zero, np.sin(half_rad)]),
        log.time_s,
    )


def _ate_m(true: PoseTrajectory3D, estimated: PoseTrajectory3D) -> float:
    true, estimated = sync.associate_trajectories(true, estimated, max_diff=MAX_APART_S)
    estimated.align(true)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((true, estimated))
    return float(ape.get_statistic(metrics.StatisticsType.rmse))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=LOGS_FOLDER)
    print(_cells(*HEADER))
    print("|---" * len(HEADER) + "|")
    for path in logs_in(parser.parse_args().folder):
        print(row(path), flush=True)


if __name__ == "__main__":
    main()

"""Where the map of a whole log is doubtful, the stretches that hold are handed out."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.mapping.offline_logs import record
from companion.offline.files import save_results
from companion.offline.reading.log import ignore
from companion.offline.reading.sensors import SensorsConfig
from companion.offline.stretches import held_stretches
from tests.logs.test_verdict import ROUND, read_of


def test_a_log_of_one_row_has_no_stretch() -> None:
    log = read_of(record(ROUND, 1)).part(slice(1))
    assert held_stretches(log, SensorsConfig(), ignore) == []


def test_the_half_with_right_ranges_is_mapped_by_itself(tmp_path: Path) -> None:
    """In the second half the ranges are shuffled."""
    log = record(ROUND, 1)
    rows = np.arange(len(log.time_s))
    half = len(rows) // 2
    np.random.default_rng(1).shuffle(rows[half:])
    log = replace(log, ranges_m={beam: ranges[rows] for beam, ranges in log.ranges_m.items()})

    (stretch,) = held_stretches(read_of(log), SensorsConfig(), ignore)

    np.testing.assert_array_equal(stretch.log.time_s, log.time_s[:half])
    true_ne_m = log.truth[:half, :2]
    error_m = np.hypot(*(stretch.path[:, :2] - true_ne_m).T)
    of_odometry_m = np.hypot(*(log.odometry[:half, :2] - true_ne_m).T)
    assert error_m.mean() < 0.5 * of_odometry_m.mean()

    save_results(stretch, [stretch], tmp_path)
    (told,) = json.loads((tmp_path / "report.json").read_text())["stretches"]
    assert (told["from_s"], told["to_s"]) == (log.time_s[0], log.time_s[half - 1])
    lines = (tmp_path / told["folder"] / "trajectory.tum").read_text().splitlines()
    assert len(lines) == half

"""Maps of recorded logs are better than the log's odometry, or the verdict is "doubtful"."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from evo.tools import file_interface
from typer.testing import CliRunner

from benchmarks.mapping.offline import outcome
from benchmarks.mapping.offline_logs import (
    ROOM,
    SCENARIOS,
    Flight,
    Log,
    Noise,
    Scenario,
    record,
    write_csv,
)
from companion.commands.cli import commands
from companion.core.messages import Beam
from companion.offline.mapper import LogMap, map_log
from companion.offline.reading.log import Log as ReadLog
from companion.offline.reading.log import Reading
from companion.offline.reading.sensors import BeamConfig, SensorsConfig

SHORT = Scenario(ROOM, Flight([(1.5, 1.5), (5.0, 1.5), (5.0, 3.0), (2.0, 3.0)], rate_hz=5))


def silent(activity: str, share: float) -> None:
    """Ignores the progress."""


def mapped(log: Log, sensors: SensorsConfig | None = None) -> LogMap:
    ranges = {beam: ranges.copy() for beam, ranges in log.ranges_m.items()}
    read = ReadLog.of(log.time_s, log.odometry.copy(), ranges, log.gyro_rad_s, Reading())
    return map_log(read, sensors or SensorsConfig(), silent)


def rms_m(path: np.ndarray[tuple[int, ...], np.dtype[np.float64]], log: Log) -> float:
    return float(np.sqrt(((path[:, :2] - log.truth[:, :2]) ** 2).sum(axis=1).mean()))


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name != "garbage"])
def test_the_map_is_better_than_that_of_the_odometry(name: str) -> None:
    """At half the benchmark's rate, for speed."""
    found = outcome(name, 2, rate_hz=1.0 if name == "sparse rows" else 5.0)
    assert found.trusted
    assert found.mapped.walls.wall_error_cm < 0.7 * found.odometry.walls.wall_error_cm
    assert found.mapped.trajectory.ate_cm < 0.5 * found.odometry.trajectory.ate_cm
    assert (
        found.mapped.trajectory.ate_take_off_frame_cm
        < 0.5 * found.odometry.trajectory.ate_take_off_frame_cm
    )


def test_four_beams_map_a_room_to_centimetres() -> None:
    found = outcome("room", 1).mapped
    assert found.walls.wall_error_cm < 4
    assert found.walls.wall_error_aligned_cm < 1.5
    assert found.walls.coverage > 0.98


def test_garbage_leaves_the_odometry_unchanged() -> None:
    log = record(replace(SHORT, noise=Noise(only_garbage=True)), 1)
    result = mapped(log)
    assert result.verdict.word == "doubtful"
    assert "ranges agree" in result.verdict.reason
    np.testing.assert_array_equal(result.path, log.odometry)


@pytest.mark.parametrize(
    "beams", [(), (Beam.FRONT,), (Beam.LEFT,), (Beam.FRONT, Beam.RIGHT), (Beam.LEFT, Beam.BACK)]
)
def test_any_set_of_beams_is_no_worse_than_odometry(beams: tuple[Beam, ...]) -> None:
    log = record(replace(SHORT, beams=beams), 3)
    result = mapped(log)
    assert rms_m(result.path, log) <= rms_m(log.odometry, log) + 1e-9
    assert len(beams) < 2 or result.verdict.trusted


def test_an_odometry_jump_is_removed() -> None:
    log = record(SHORT, 1)
    log.odometry[45:, :2] += (6.0, -4.0)
    result = mapped(log)
    assert result.jumps == 1
    assert rms_m(result.path, log) < 0.1


def test_a_heading_jump_is_removed_if_there_is_a_gyro() -> None:
    log = record(SHORT, 1)
    rate_rad_s = np.gradient(log.odometry[:, 2], log.time_s)
    log.odometry[45:, 2] += math.radians(20)
    result = mapped(replace(log, gyro_rad_s=rate_rad_s))
    assert result.jumps == 1
    assert rms_m(result.path, log) < 0.15


def test_a_stuck_beam_is_ignored() -> None:
    log = record(SHORT, 1)
    log.ranges_m[Beam.LEFT][:] = 1.0
    result = mapped(log)
    assert result.verdict.trusted
    assert rms_m(result.path, log) < 0.1


def test_mounts_come_from_the_configuration() -> None:
    """Sensors 10 cm ahead of the centre, and the left one turned by 20 degrees."""
    log = record(SHORT, 1)
    turned = {Beam.LEFT: Beam.FRONT, Beam.FRONT: Beam.LEFT, Beam.RIGHT: Beam.RIGHT}
    log.ranges_m.update({beam: log.ranges_m[source] - 0.1 for beam, source in turned.items()})
    log.ranges_m[Beam.BACK] -= 0.1
    front, left = BeamConfig(bearing_deg=-90), BeamConfig(bearing_deg=0)
    result = mapped(log, SensorsConfig(offset_m=0.1, front=front, left=left))
    assert result.verdict.trusted
    assert rms_m(result.path, log) < 0.1


def test_long_runs_are_solved_in_windows() -> None:
    corners = [(8.5, 1.5), (8.5, 8.5), (1.5, 8.5), (1.5, 1.5)]
    log = record(Scenario(ROOM, Flight([(1.5, 1.5), *corners * 3], rate_hz=4, spin_rad=0)), 1)
    result = mapped(log)
    assert result.verdict.trusted
    assert rms_m(result.path, log) < 0.1


def test_the_command_writes_files_that_other_programs_read(tmp_path: Path) -> None:
    log, path, out = record(SHORT, 1), tmp_path / "room.csv", tmp_path / "out"
    log.ranges_m[Beam.UP] = np.full(len(log.time_s), 1.5)
    log.ranges_m[Beam.DOWN] = np.full(len(log.time_s), 1.0)
    log.ranges_m[Beam.UP][::2] += 0.01
    log.ranges_m[Beam.DOWN][::2] -= 0.01
    write_csv(log, path, gyro=True)
    (tmp_path / "room.toml").write_text("[sensors]\nsigma_m = 0.05\nmax_m = 5.5\n")
    result = CliRunner().invoke(commands, ["map", str(path), "--out", str(out)])
    assert result.exit_code == 0, result.output
    assert "trusted" in result.output
    names = {"map.json", "map.png", "map.ply", "trajectory.tum", "report.json"}
    assert {file.name for file in out.iterdir()} == names
    trajectory = file_interface.read_tum_trajectory_file(str(out / "trajectory.tum"))
    assert trajectory.check()[0]
    assert trajectory.num_poses == len(log.time_s)
    report = json.loads((out / "report.json").read_text())
    assert report["verdict"] == "trusted"
    assert report["rows"]["used"] == len(log.time_s)
    assert report["ceiling_m"] == pytest.approx(2.5, abs=0.02)
    assert report["agreement"]["rms_m"] == pytest.approx(0.05, abs=0.01)
    assert report["walls"]


def test_the_same_log_gives_the_same_map() -> None:
    first, second = (mapped(record(SHORT, 1)) for _ in range(2))
    np.testing.assert_array_equal(first.path, second.path)
    assert first.plan == second.plan

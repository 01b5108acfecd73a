"""Logs are read completely, read in part with the reason, or rejected in one line."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from companion.core.errors import ConfigError, LogError
from companion.core.messages import Beam
from companion.offline.files import report, trajectory_tum
from companion.offline.mapper import map_log
from companion.offline.reading.log import Log
from companion.offline.reading.readers import read_log
from companion.offline.reading.sensors import SensorsConfig, load
from tests.examples import examples

HEADER = "time_s,odom_x_m,odom_y_m,odom_yaw_rad,front_m"


def silent(activity: str, share: float) -> None:
    """Ignores the progress."""


def read(tmp_path: Path, text: str) -> Log:
    path = tmp_path / "flight.csv"
    path.write_text(text)
    return read_log(path, silent)


def refused(tmp_path: Path, text: str) -> str:
    with pytest.raises(LogError) as error:
        read(tmp_path, text)
    assert "\n" not in str(error.value)
    assert "flight.csv" in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ("line 1", "no header", "time_s")),
        ("\n\n", ("no header",)),
        (HEADER + "\n", ("no row",)),
        ("time_s,odom_x_m\n0,0\n", ("line 1", "odom_y_m, odom_yaw_rad")),
        (HEADER + ",front_m\n0,0,0,0,1,1\n", ("front_m", "2 times")),
        (HEADER + "\n0,0,here,0,1\n", ("1 rows skipped", "odom_y_m", "line 2", "'here'")),
        (HEADER + "\n0,0\n0,0\n", ("2 rows skipped", "wrong number of cells", "line 2")),
    ],
)
def test_invalid_logs_are_refused_with_the_reason(
    tmp_path: Path, text: str, words: tuple[str, ...]
) -> None:
    message = refused(tmp_path, text)
    assert all(word in message for word in words)


def test_a_missing_file_or_an_unknown_file_type_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="No such file"):
        read_log(tmp_path / "nowhere.csv", silent)
    with pytest.raises(LogError, match=r"\.csv"):
        read_log(tmp_path / "flight.bag", silent)
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(LogError, match="Is a directory"):
        read_log(tmp_path / "folder.csv", silent)


def test_columns_may_have_any_order_and_unknown_ones_are_reported(tmp_path: Path) -> None:
    log = read(
        tmp_path, "left_m,battery,odom_yaw_rad,odom_y_m,odom_x_m,time_s\n1.5,11.1,0.3,2,1,10\n"
    )
    assert log.odometry.tolist() == [[1, 2, 0.3]]
    assert log.ranges_m[Beam.LEFT].tolist() == [1.5]
    assert log.reading.columns_ignored == ("battery",)


def test_rows_are_sorted_and_repeated_times_are_skipped(tmp_path: Path) -> None:
    log = read(tmp_path, HEADER + "\n0,0,0,0,1\n2,2,0,0,1\n1,1,0,0,1\n2,9,9,9,9\n")
    assert log.time_s.tolist() == [0, 1, 2]
    assert log.odometry[:, 0].tolist() == [0, 1, 2]
    assert log.reading.rows_sorted == 1
    assert log.reading.rows_skipped["time repeated"].count == 1


def test_a_wrapped_heading_is_unwrapped(tmp_path: Path) -> None:
    log = read(tmp_path, HEADER + "\n0,0,0,3.1,1\n1,0,0,-3.1,1\n")
    assert log.odometry[1, 2] == pytest.approx(3.1832, abs=1e-3)


@pytest.mark.parametrize("cell", ["", " ", "nan", "NaN", "inf", "-inf"])
def test_an_empty_or_infinite_range_is_no_error(tmp_path: Path, cell: str) -> None:
    log = read(tmp_path, HEADER + f"\n0,0,0,0,{cell}\n")
    assert np.isnan(log.ranges_m[Beam.FRONT][0])
    assert not log.reading.cells_skipped


@pytest.mark.parametrize("cell", ["x", "1.2.3", "0x1f", "1_0", "-1", "0", "1e300", "[bold"])
def test_an_invalid_range_is_counted(tmp_path: Path, cell: str) -> None:
    log = read(tmp_path, HEADER + f"\n0,0,0,0,{cell}\n")
    assert np.isnan(log.ranges_m[Beam.FRONT][0])
    (skipped,) = log.reading.cells_skipped.values()
    assert skipped.count == 1
    assert "line 2" in skipped.first


NUMBERS = st.one_of(
    st.floats(-10, 10).map(str),
    st.floats().map(str),
    st.sampled_from(["", "nan", "inf", "1e308", "-0", "1,5", '"1"', "abc", "\x00", "é", "1e-320"]),
)
COLUMNS = st.permutations([*HEADER.split(","), "left_m", "up_m", "gyro_z_rad_s"])


@settings(deadline=None, max_examples=examples(40), suppress_health_check=[HealthCheck.too_slow])
@given(
    header=st.one_of(COLUMNS.map(",".join), st.text(max_size=40)),
    rows=st.lists(st.lists(NUMBERS, min_size=7, max_size=9).map(",".join), max_size=12),
    raw=st.binary(max_size=60),
)
@example(header=HEADER, rows=["0,0,0,0,1e-320"], raw=b"")
def test_garbage_gives_a_map_or_a_log_error(
    tmp_path_factory: pytest.TempPathFactory, header: str, rows: list[str], raw: bytes
) -> None:
    path = tmp_path_factory.mktemp("log") / "flight.csv"
    path.write_bytes("\n".join([header, *rows]).encode("utf-8", "replace") + raw)
    try:
        log = read_log(path, silent)
    except LogError:
        return
    result = map_log(log, SensorsConfig(), silent)
    json.dumps(report(result), allow_nan=False)
    assert len(trajectory_tum(result).splitlines()) == len(log.time_s)


def config_refused(tmp_path: Path, text: str) -> str:
    path = tmp_path / "flight.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as error:
        load(None, tmp_path / "flight.csv")
    assert "\n" not in str(error.value)
    assert "flight.toml" in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[sensors]\nsigma = 1\n", ("sensors.sigma", "no such key", "sigma_m")),
        ("[sensors]\nsigma_m = 2\n", ("sensors.sigma_m", "2", "less than or equal to 1")),
        ("[sensors.front]\nbearing_deg = 'ahead'\n", ("sensors.front.bearing_deg", "ahead")),
        ("[sensors.front]\nbearing = 3\n", ("sensors.front.bearing", "bearing_deg")),
        ("[sensors.up]\nbearing_deg = 3\n", ("sensors.up.bearing_deg", "no such key")),
        ("[sensors]\nmax_m = 1\n[sensors.left]\nmin_m = 2\n", ("left", "min_m = 2", "max_m = 1")),
        ("[link]\nurl = 'x'\n", ("link", "no such key", "sensors")),
        ("[sensors\n", ("not TOML",)),
    ],
)
def test_invalid_sensor_configurations_are_refused(
    tmp_path: Path, text: str, words: tuple[str, ...]
) -> None:
    message = config_refused(tmp_path, text)
    assert all(word in message for word in words)


def test_keys_of_a_beam_override_the_common_keys(tmp_path: Path) -> None:
    (tmp_path / "flight.toml").write_text(
        "[sensors]\nsigma_m = 0.02\noffset_m = 0.08\n"
        "[sensors.left]\nbearing_deg = -45\nsigma_per_m2 = 0.01\noffset_m = 0.0\n"
    )
    sensors = load(None, tmp_path / "flight.csv")
    left, right = sensors.of(Beam.LEFT), sensors.of(Beam.RIGHT)
    assert (left.sigma_m, left.sigma_per_m2, left.offset_m) == (0.02, 0.01, 0.0)
    assert (right.sigma_m, right.sigma_per_m2, right.offset_m) == (0.02, None, 0.08)
    assert sensors.bearing_rad(Beam.LEFT) == pytest.approx(-np.pi / 4)
    assert sensors.bearing_rad(Beam.BACK) == pytest.approx(np.pi)


def test_a_missing_default_file_gives_defaults_but_a_named_file_must_exist(tmp_path: Path) -> None:
    assert load(None, tmp_path / "flight.csv") == SensorsConfig()
    with pytest.raises(ConfigError, match="No such file"):
        load(tmp_path / "none.toml", tmp_path / "flight.csv")


@pytest.mark.parametrize("folder", [".", "..", "/"])
def test_a_folder_in_place_of_a_log_is_refused_in_one_line(folder: str) -> None:
    assert load(None, Path(folder)) == SensorsConfig()
    with pytest.raises(LogError, match=r"unknown log format; known: \.csv"):
        read_log(Path(folder), silent)


def test_gyro_cells_that_are_no_numbers_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "flight.csv"
    path.write_text(
        HEADER.replace("front_m", "gyro_z_rad_s") + "\n0,0,0,0,left\n1,0,0,0,\n2,0,0,0,nan\n"
    )
    (reason,) = read_log(path, silent).reading.cells_skipped.items()
    assert reason[0] == "gyro_z_rad_s not a number"
    assert (reason[1].count, reason[1].first) == (1, "line 2: 'left'")

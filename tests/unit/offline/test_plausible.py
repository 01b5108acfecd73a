"""Logs in other units than those of their columns, or with a clock that was set, are rejected."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.arrays import Array
from companion.core.errors import LogError
from companion.offline.reading.log import Log, Reading
from companion.offline.reading.readers import read_log

HEADER = "time_s,odom_x_m,odom_y_m,odom_yaw_rad,gyro_z_rad_s,front_m,left_m"
TIME, X, Y, YAW, GYRO, FRONT, LEFT = range(7)


def silent(activity: str, share: float) -> None:
    """Ignores the progress."""


def flown(*, hz: float = 10.0, turn_rad_s: float = 0.5, wraps: bool = False) -> Array:
    """Straight legs and turns in place in alternation, at 0.4 m/s."""
    time_s = np.arange(0, 60, 1 / hz)
    turning = (time_s // 5) % 2 == 1
    yaw = np.cumsum(np.where(turning, turn_rad_s / hz, 0.0))
    going = np.where(turning, 0.0, 0.4 / hz)
    x, y = np.cumsum(going * np.cos(yaw)), np.cumsum(going * np.sin(yaw))
    heading = (yaw + math.pi) % math.tau - math.pi if wraps else yaw
    gyro = np.where(turning, turn_rad_s, 0.0)
    return np.column_stack(
        [time_s, x, y, heading, gyro, 2 + np.sin(time_s), 1 + 0.1 * np.cos(time_s)]
    )


def read(tmp_path: Path, rows: Array, *, without: tuple[int, ...] = ()) -> Log:
    kept = [column for column in range(7) if column not in without]
    names = HEADER.split(",")
    lines = [",".join(names[column] for column in kept)]
    lines += [",".join(repr(float(row[column])) for column in kept) for row in rows]
    path = tmp_path / "flight.csv"
    path.write_text("\n".join(lines))
    return read_log(path, silent)


def refusal(tmp_path: Path, rows: Array, *, without: tuple[int, ...] = ()) -> str:
    with pytest.raises(LogError, match=r"flight\.csv") as refused:
        read(tmp_path, rows, without=without)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def times(column: int, factor: float, rows: Array | None = None) -> Array:
    rows = flown() if rows is None else rows.copy()
    rows[:, column] *= factor
    return rows


@given(
    hz=st.floats(1, 100),
    turn_deg_s=st.floats(-180, 180),
    wraps=st.booleans(),
    began_s=st.sampled_from([0.0, -5.0, 1e4, 1.76e9]),
    has_gyro=st.booleans(),
)
def test_plausible_logs_are_not_refused(
    hz: float, turn_deg_s: float, wraps: bool, began_s: float, has_gyro: bool
) -> None:
    turn_rad_s = max(-0.7 * hz, min(0.7 * hz, math.radians(turn_deg_s)))
    rows = flown(hz=hz, turn_rad_s=turn_rad_s, wraps=wraps)
    gyro = rows[:, GYRO] if has_gyro else None
    log = Log.of(rows[:, TIME] + began_s, rows[:, X : YAW + 1].copy(), {}, gyro, Reading())
    assert len(log.time_s) == len(rows)


@pytest.mark.parametrize(
    ("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")]
)
@pytest.mark.parametrize("hz", [2, 10, 50])
def test_time_in_smaller_units_is_refused(
    tmp_path: Path, factor: float, unit: str, hz: float
) -> None:
    message = refusal(tmp_path, times(TIME, factor, flown(hz=hz)))
    assert "time_s" in message
    assert f"if these are {unit}, divide by" in message


def test_time_in_days_is_refused(tmp_path: Path) -> None:
    assert "multiply by 86400" in refusal(tmp_path, times(TIME, 1 / 86400))


def test_unix_time_in_milliseconds_is_refused(tmp_path: Path) -> None:
    rows = times(TIME, 1e3)
    rows[:, TIME] += 1.76e12
    message = refusal(tmp_path, rows)
    assert "time_s beyond 1e+11 s" in message
    assert "milliseconds" in message


def test_time_in_whole_seconds_is_refused(tmp_path: Path) -> None:
    rows = flown()
    rows[:, TIME] = np.floor(rows[:, TIME])
    assert "rounded" in refusal(tmp_path, rows)


@pytest.mark.parametrize("since_s", [1.7e9, -3.0, -20.0, 86400.0])
def test_a_clock_set_in_flight_is_refused(tmp_path: Path, since_s: float) -> None:
    """The computer starts without a network, and the network sets its clock later."""
    rows = flown()
    rows[300:, TIME] += since_s
    message = refusal(tmp_path, rows)
    assert "the clock was set" in message
    assert "goes back" in message if since_s < 0 else "leaps" in message


def test_a_second_flight_in_the_same_log_is_refused(tmp_path: Path) -> None:
    assert "logs were joined" in refusal(tmp_path, np.vstack([flown(), flown(hz=7)]))


def test_late_rows_are_sorted(tmp_path: Path) -> None:
    rows = flown()
    late = rows.copy()
    late[[100, 125]] = late[[125, 100]]
    halves = np.vstack([rows[300:], rows[:300]])
    buffered = np.vstack([rows[:300], rows[320:380], rows[300:320], rows[380:]])
    for shuffled in (late, rows[::-1], halves, buffered):
        assert (read(tmp_path, shuffled).time_s == rows[:, TIME]).all()


@pytest.mark.parametrize("factor", [1000, 100])
def test_positions_in_millimetres_or_centimetres_are_refused(tmp_path: Path, factor: float) -> None:
    rows = times(Y, factor, times(X, factor))
    assert "if these are millimetres, divide by 1000; if centimetres" in refusal(tmp_path, rows)


@pytest.mark.parametrize("without", [(), (GYRO,)])
@pytest.mark.parametrize("wraps", [False, True])
@pytest.mark.parametrize(("hz", "turn_deg_s"), [(1, 40), (10, 30), (10, 90), (50, 15)])
def test_headings_in_degrees_are_refused(
    tmp_path: Path, hz: float, turn_deg_s: float, wraps: bool, without: tuple[int, ...]
) -> None:
    rows = flown(hz=hz, turn_rad_s=math.radians(turn_deg_s), wraps=wraps)
    message = refusal(tmp_path, times(YAW, math.degrees(1), rows), without=without)
    assert "odom_yaw_rad" in message
    assert "multiply by 0.0174533" in message


def test_gyro_rates_in_degrees_are_refused(tmp_path: Path) -> None:
    message = refusal(tmp_path, times(GYRO, math.degrees(1)))
    assert "gyro_z_rad_s: is 57 times" in message
    assert "0.0174533" in message


def test_ranges_in_millimetres_are_refused(tmp_path: Path) -> None:
    message = refusal(tmp_path, times(FRONT, 1000))
    assert "front_m: 600 of 600 are beyond 200 m" in message
    assert "divide by 1000" in message


@pytest.mark.parametrize("nothing", [999.0, 65535.0])
def test_a_constant_for_nothing_in_range_is_not_taken_for_a_wrong_unit(
    tmp_path: Path, nothing: float
) -> None:
    rows = flown()
    rows[50:, FRONT] = nothing
    log = read(tmp_path, rows)
    (skipped,) = log.reading.cells_skipped.values()
    assert skipped.count == 550


@pytest.mark.parametrize("spoil", [lambda v: v, lambda v: v * np.nan, lambda v: v[::-1]])
def test_an_uninformative_gyro_does_not_refuse_the_log(
    tmp_path: Path, spoil: Callable[[Array], Array]
) -> None:
    rows = flown()
    rows[:, GYRO] = spoil(rows[:, GYRO])
    read(tmp_path, rows)

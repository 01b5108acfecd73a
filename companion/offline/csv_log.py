"""Reader of logs as plain CSV; docs/offline.md describes the columns.

What cannot be used is skipped and counted, row by row or range by range, with the line where it
was first met; only a file without a usable row is refused.
"""

import math
import os
from array import array
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np

from companion.errors import LogError
from companion.messages import Beam
from companion.offline.log import Array, Log, Reading, Watch

MOTION = ("time_s", "odom_x_m", "odom_y_m", "odom_yaw_rad")
MOST = (1e11, 1e6, 1e6, 1e4)
"""Larger values than these, whatever the sign, are no time, place or heading."""
GYRO = "gyro_z_rad_s"
BEAM_COLUMNS = {f"{beam}_m": beam for beam in Beam}
MOST_RANGE_M = 200.0
ROWS_BETWEEN_NEWS = 20_000
SHOWN = 40
"""Characters of a cell that a message repeats."""


def read_csv(path: Path, watch: Watch) -> Log:
    """The log in a CSV file.

    Raises:
        LogError: not readable, a column is missing, or there is no row to use.
    """
    try:
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            return _read(file, watch)
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}") from error
    except LogError as error:
        raise LogError(f"{path}: {error}") from error


@dataclass(frozen=True, slots=True)
class _Header:
    """Where each column stands."""

    width: int
    motion: tuple[int, ...]
    beams: dict[str, int]
    gyro: int | None
    ignored: tuple[str, ...]


def _read(file: TextIO, watch: Watch) -> Log:
    header = _header(file.readline())
    reading = Reading(columns_ignored=header.ignored)
    motion, ranges = array("d"), {name: array("d") for name in header.beams}
    gyro = array("d")
    size = max(os.fstat(file.fileno()).st_size, 1)
    for line, text in enumerate(iter(file.readline, ""), start=2):
        if text.isspace():
            continue
        row = text.rstrip("\n").split(",")
        reading.rows += 1
        if reading.rows % ROWS_BETWEEN_NEWS == 0:
            watch("reading", min(file.buffer.tell() / size, 1.0))
        values = _motion(row, header, reading, line)
        if values is None:
            continue
        motion.extend(values)
        for name, column in header.beams.items():
            ranges[name].append(_range_m(row[column], name, reading, line))
        if header.gyro is not None:
            gyro.append(_number(row[header.gyro]))
    table = np.array(motion).reshape(-1, len(MOTION))
    by_beam = {BEAM_COLUMNS[name]: np.array(values) for name, values in ranges.items()}
    rates: Array | None = np.array(gyro) if header.gyro is not None else None
    return Log.of(table[:, 0], table[:, 1:].copy(), by_beam, rates, reading)


def _header(line: str) -> _Header:
    names = [cell.strip().strip('"') for cell in line.split(",")]
    if not any(names):
        raise LogError(f"line 1: no header; expected {','.join(MOTION)} and beams")
    missing = [name for name in MOTION if name not in names]
    if missing:
        found = ",".join(names)[: 2 * SHOWN]
        raise LogError(f"line 1: no column {', '.join(missing)}; found {found!r}")
    known = {*MOTION, *BEAM_COLUMNS, GYRO}
    twice = sorted({name for name in names if name in known and names.count(name) > 1})
    if twice:
        raise LogError(f"line 1: column {twice[0]} stands there {names.count(twice[0])} times")
    return _Header(
        len(names),
        tuple(names.index(name) for name in MOTION),
        {name: names.index(name) for name in BEAM_COLUMNS if name in names},
        names.index(GYRO) if GYRO in names else None,
        tuple(name for name in names if name not in known),
    )


def _motion(
    row: list[str], header: _Header, reading: Reading, line: int
) -> tuple[float, ...] | None:
    if len(row) != header.width:
        reading.skip_row("wrong number of cells", f"line {line}: {len(row)} cells")
        return None
    values = tuple(_number(row[column]) for column in header.motion)
    for name, column, value, most in zip(MOTION, header.motion, values, MOST, strict=True):
        if not abs(value) <= most:
            reason = f"{name} missing, not a number, or beyond {most:g}"
            reading.skip_row(reason, f"line {line}: {row[column][:SHOWN]!r}")
            return None
    return values


def _range_m(cell: str, name: str, reading: Reading, line: int) -> float:
    """A range; NaN if nothing returned, which an empty cell, NaN and infinity all say."""
    if not cell or cell.isspace():
        return math.nan
    value = _number(cell)
    if 0 < value <= MOST_RANGE_M:
        return value
    if math.isnan(value) and cell.strip().lower().lstrip("+-") != "nan":
        reading.skip_cell(f"{name} not a number", f"line {line}: {cell[:SHOWN]!r}")
    elif math.isfinite(value):
        reading.skip_cell(
            f"{name} not between 0 and {MOST_RANGE_M:g}", f"line {line}: {cell[:SHOWN]!r}"
        )
    return math.nan


def _number(cell: str) -> float:
    """NaN for what is none; Python's own digit separators are none either."""
    try:
        return float(cell) if "_" not in cell else math.nan
    except ValueError:
        return math.nan

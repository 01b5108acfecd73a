"""Reads logs in plain CSV; docs/offline.md describes the columns.

Invalid rows and ranges are skipped and counted, with the line of the first. Only a file without any
valid row is rejected.
"""

import math
import os
import zlib
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from gzip import BadGzipFile
from pathlib import Path
from typing import TextIO

import numpy as np

from companion.core.arrays import Array
from companion.core.errors import LogError
from companion.core.messages import Beam
from companion.offline.reading.dialect import Numbers, opened, read_header
from companion.offline.reading.log import Log, Reading, Watch

MOTION = ("time_s", "odom_x_m", "odom_y_m", "odom_yaw_rad")
"""Required columns."""
MAX_VALUES = (1e11, 1e6, 1e6, 1e4)
"""Limits of their absolute values: time, s, place, m, and heading, rad. Chosen."""
GYRO = "gyro_z_rad_s"
"""Optional column of the gyro's yaw rate."""
BEAM_COLUMNS = {f"{beam}_m": beam for beam in Beam}
"""Optional columns of the ranges."""
KNOWN = {*MOTION, *BEAM_COLUMNS, GYRO}
"""Names of all known columns."""
MAX_RANGE_M = 200.0
"""Largest valid range, m. Chosen."""
ROWS_PER_REPORT = 20_000
"""Rows between two progress reports. Chosen."""
MIN_DIFFERENT = 10
"""Least number of different ranges beyond the limit that shows a wrong unit. Chosen: a single value
would be the code for nothing in range."""
MAX_SHOWN = 40
"""Characters of a cell that a message shows. Chosen."""


def read_csv(path: Path, watch: Watch) -> Log:
    """Read the log in a CSV file.

    Raises:
        LogError: not readable, a column is missing, no row is valid, or the numbers are not in the
            units of the columns' names.
    """
    try:
        with opened(path) as (text, raw):
            size = max(os.fstat(raw.fileno()).st_size, 1)
            return _read(text, lambda: watch("reading", min(raw.tell() / size, 1.0)))
    except LogError as error:
        raise LogError(f"{path}: {error}") from error
    except (EOFError, BadGzipFile, zlib.error) as error:
        raise LogError(f"{path}: compressed, and cut short or damaged: {error}") from error
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}") from error


@dataclass(frozen=True, slots=True)
class _Header:
    """Positions of the columns."""

    width: int
    named: int
    """Cells up to the last column with a name; spreadsheets append empty ones to the header."""
    motion: tuple[int, ...]
    beams: dict[str, int]
    gyro: int | None
    ignored: tuple[str, ...]


def _read(file: TextIO, report: Callable[[], None]) -> Log:
    lines, dialect, names = read_header(file, KNOWN)
    header, numbers = _header(names, lines), Numbers()
    reading = Reading(columns_ignored=header.ignored)
    motion, ranges = array("d"), {name: _Ranges(name, numbers, reading) for name in header.beams}
    gyro = array("d")
    for line, text in dialect.lines(file):
        if not text.strip():
            continue
        row = _of_width(dialect.cells(text), header.width)
        reading.rows += 1
        if reading.rows % ROWS_PER_REPORT == 0:
            report()
        where = f"line {line + lines + 1}"
        values = _motion(row, header, numbers, reading, where)
        if values is None:
            continue
        motion.extend(values)
        for name, column in header.beams.items():
            ranges[name].add(row[column], where)
        if header.gyro is not None:
            gyro.append(_rate_rad_s(row[header.gyro], numbers, reading, where))
    table = np.array(motion).reshape(-1, len(MOTION))
    by_beam = {BEAM_COLUMNS[name]: values.checked() for name, values in ranges.items()}
    rates: Array | None = np.array(gyro) if header.gyro is not None else None
    return Log.of(table[:, 0], table[:, 1:].copy(), by_beam, rates, reading)


def _of_width(row: list[str], width: int) -> list[str]:
    """Drop the empty cells that spreadsheets append to a row."""
    return row[:width] if not any(cell.strip() for cell in row[width:]) else row


def _header(names: list[str], line: int) -> _Header:
    if not any(names):
        raise LogError(f"line {line}: no header; expected {','.join(MOTION)} and beams")
    missing = [name for name in MOTION if name not in names]
    if missing:
        found = ",".join(names)[: 2 * MAX_SHOWN]
        raise LogError(f"line {line}: no column {', '.join(missing)}; found {found!r}")
    twice = sorted({name for name in names if name in KNOWN and names.count(name) > 1})
    if twice:
        raise LogError(f"line {line}: column {twice[0]} occurs {names.count(twice[0])} times")
    return _Header(
        len(names),
        max(i for i, name in enumerate(names, start=1) if name),
        tuple(names.index(name) for name in MOTION),
        {name: names.index(name) for name in BEAM_COLUMNS if name in names},
        names.index(GYRO) if GYRO in names else None,
        tuple(name for name in names if name not in KNOWN and name),
    )


def _motion(
    row: list[str], header: _Header, numbers: Numbers, reading: Reading, where: str
) -> tuple[float, ...] | None:
    if not header.named <= len(row) <= header.width:
        reading.skip_row("wrong number of cells", f"{where}: {len(row)} cells")
        return None
    values = tuple(numbers.read(row[column]) for column in header.motion)
    for name, column, value, most in zip(MOTION, header.motion, values, MAX_VALUES, strict=True):
        if not abs(value) <= most:
            reason = f"{name} missing, not a number, or beyond {most:g}"
            if name == "time_s" and math.isfinite(value):
                reason = f"time_s beyond {most:g} s; convert milliseconds or nanoseconds to seconds"
            reading.skip_row(reason, f"{where}: {row[column][:MAX_SHOWN]!r}")
            return None
    return values


def _rate_rad_s(cell: str, numbers: Numbers, reading: Reading, where: str) -> float:
    """The yaw rate of a cell. An empty cell, NaN and infinity mean that it is missing."""
    value = numbers.read(cell)
    if _is_no_number(cell, value):
        reading.skip_cell(f"{GYRO} not a number", f"{where}: {cell[:MAX_SHOWN]!r}")
    return value


def _is_no_number(cell: str, value: float) -> bool:
    """True if a cell is neither a number nor marked as missing."""
    text = cell.strip().lower()
    return math.isnan(value) and text != "" and text.lstrip("+-") != "nan"


class _Ranges:
    """Ranges of one beam."""

    def __init__(self, name: str, numbers: Numbers, reading: Reading) -> None:
        self._name = name
        self._numbers = numbers
        self._reading = reading
        self._values = array("d")
        self._far_count = 0
        self._far_values: set[float] = set()

    def add(self, cell: str, where: str) -> None:
        self._values.append(self._range_m(cell, where))

    def checked(self) -> Array:
        """All ranges; NaN without a return.

        Raises:
            LogError: most are not ranges in metres. A single repeated number is a code for nothing
        in
                range, not a unit error.
        """
        values = np.array(self._values)
        if len(self._far_values) >= MIN_DIFFERENT and self._far_count > np.isfinite(values).sum():
            raise LogError(
                f"{self._name}: {self._far_count} of {len(values)} are beyond {MAX_RANGE_M:g} m: "
                "if these are millimetres, divide by 1000; if centimetres, by 100"
            )
        return values

    def _range_m(self, cell: str, where: str) -> float:
        """The range of a cell. An empty cell, NaN and infinity mean no return and give NaN."""
        value = self._numbers.read(cell)
        if 0 < value <= MAX_RANGE_M:
            return value
        if _is_no_number(cell, value):
            self._reading.skip_cell(f"{self._name} not a number", f"{where}: {cell[:MAX_SHOWN]!r}")
        elif math.isfinite(value):
            reason = f"{self._name} not between 0 and {MAX_RANGE_M:g}"
            self._reading.skip_cell(reason, f"{where}: {cell[:MAX_SHOWN]!r}")
            if value > MAX_RANGE_M:
                self._far_count += 1
                if len(self._far_values) < MIN_DIFFERENT:
                    self._far_values.add(value)
        return math.nan

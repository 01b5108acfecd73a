"""Reads and updates a parameter file in the formats of the ground stations.

    GUID_TIMEOUT 0.5                  Mission Planner, MAVProxy: separated by a blank or a comma
    1 <tab> 1 <tab> GUID_TIMEOUT <tab> 0.5 <tab> 9
                                      QGroundControl: vehicle, component, name, value, type

A # starts a comment. Setting a parameter replaces its value in the file or appends a line; all
other lines stay as they are.
"""

import math
import os
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from companion.core.textfile import NotTextError, read_text, reason
from sitl.autopilot.parameters.table import ParameterError, Table, named

LINE = re.compile(r"(\s*(?:\d+\s+\d+\s+)?(\w+)(?:\s*,\s*|\s+))([^\s,#]+)((?:\s+\d+)?\s*(?:#.*)?)")
"""Groups: all before the value, within it the name; the value; all after it."""


class ParameterFile:
    """One file; `keep` is a `ParameterWatch`.

    Raises:
        ParameterError: the file, or a line given with its number, cannot be used.
    """

    def __init__(self, path: Path, table: Table) -> None:
        self._path = path.resolve()
        self.values: dict[str, float] = {}
        self._line_of: dict[str, int] = {}
        self._lines = self._read()
        for number, line in enumerate(self._lines):
            if line.split("#")[0].strip():
                self._take(line, number, table)

    def keep(self, name: str, value: float) -> None:
        """Write one value to the file."""
        if self.values.get(name) == value:
            return
        self.values[name] = value
        if name in self._line_of:
            before, _, _, after = _parts(self._lines[self._line_of[name]])
            self._lines[self._line_of[name]] = f"{before}{_shown(value)}{after}"
        else:
            self._line_of[name] = len(self._lines)
            self._lines.append(f"{name} {_shown(value)}")
        self._write()

    def _read(self) -> list[str]:
        try:
            if self._path.exists():
                return read_text(self._path).splitlines()
        except (OSError, NotTextError) as error:
            raise ParameterError(f"{self._path}: {reason(error)}") from error
        if not os.access(self._path.parent, os.W_OK):
            raise ParameterError(f"{self._path}: cannot be written there; choose another --params")
        return []

    def _take(self, line: str, number: int, table: Table) -> None:
        where = f"{self._path}:{number + 1}"
        try:
            _, name, text, _ = _parts(line)
            named(table, name)
            self.values[name] = _number(name, text)
        except ParameterError as error:
            raise ParameterError(f"{where}: {error}") from error
        self._line_of[name] = number

    def _write(self) -> None:
        """Write atomically: a new file replaces the old one once it is on the disk."""
        new = self._path.with_name(f"{self._path.name}.new")
        try:
            with new.open("w", encoding="utf-8") as file:
                file.write("".join(f"{line}\n" for line in self._lines))
                file.flush()
                os.fsync(file.fileno())
            new.replace(self._path)
        except OSError as error:
            raise ParameterError(f"{self._path}: {error}; parameters cannot be kept") from error


def parse_assignments(texts: Iterable[str], table: Table) -> dict[str, float]:
    """Parse NAME=VALUE, as on a command line.

    Raises:
        ParameterError: a text is malformed or its parameter unknown.
    """
    values = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise ParameterError(f"--param {text}: write NAME=VALUE")
        named(table, name)
        values[name] = _number(name, value)
    return values


def beyond_range(values: dict[str, float], table: Table) -> list[str]:
    """A line for each value outside its documented range; autopilots take such values too."""
    return [
        f"{name} {value:g} is outside {p.least:g} to {p.most:g}, its documented range"
        for name, value in values.items()
        if not (p := table[name]).least <= value <= p.most
    ]


def _parts(line: str) -> tuple[str, str, str, str]:
    match = LINE.fullmatch(line)
    if match is None:
        raise ParameterError(f"{line.strip()!r} is not a parameter; write NAME VALUE")
    before, name, value, after = match.groups()
    return before, name, value, after


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ParameterError(f"{name} {text}: not a number")
    return value


def _shown(value: float) -> str:
    """The shortest text for this value: integers without decimals, others as single floats."""
    if value.is_integer():
        return str(int(value))
    return np.format_float_positional(np.float32(value), trim="-")

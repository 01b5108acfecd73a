"""The rows of a campaign in a folder of Parquet files, written as they come.

rows/0000012.parquet   one file for each row, or for many of them: small files are joined

A crash loses nothing: each file is complete before it has its name. After a crash between joining
and deletion a row is in two files; readers take it once.
"""

import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from numbers import Real
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import parquet

from companion.core.errors import OutputError
from companion.core.textfile import reason
from companion.export.map_files import save_as
from sitl.campaign.scores import Row
from sitl.core.errors import SitlError

KEY = ("flight", "program")
"""Columns that identify a row: the settings, and the program that has flown them."""
MIXED = b"mixed"
"""Metadata of a file: the list of its columns whose values are JSON."""
JOIN_AT = 100
"""Number of small files that are joined. Chosen."""


class ResultsError(SitlError):
    """The rows of a campaign cannot be read."""


class Results:
    """The rows in a folder; new ones are kept there at once."""

    def __init__(self, folder: Path) -> None:
        """Raises: OutputError: the folder cannot be made. ResultsError: a file is no Parquet."""
        self._folder = folder / "rows"
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{self._folder}: {reason(error)}") from error
        files = row_files(self._folder)
        self._next = int(files[-1].stem) + 1 if files else 0
        self.known = {tuple(row[key] for key in KEY) for row in read_rows(folder)}
        """Values of `KEY` of all rows."""
        self._small = [path for path in files if parquet.read_metadata(path).num_rows == 1]

    def add(self, row: Row) -> None:
        """Keep a row.

        Raises:
            OutputError: it cannot be written.
        """
        self._small.append(self._write([row]))
        self.known.add(tuple(row[key] for key in KEY))
        if len(self._small) >= JOIN_AT:
            self._write([each for path in self._small for each in _read(path)])
            for path in self._small:
                with suppress(OSError):
                    path.unlink()
            self._small = []

    def _write(self, rows: Sequence[Row]) -> Path:
        path = self._folder / f"{self._next:07d}.parquet"
        save_table(rows, path)
        self._next += 1
        return path


def read_rows(folder: Path) -> list[Row]:
    """All rows, each once, in the order in which they came.

    Raises:
        ResultsError: a file is no Parquet.
    """
    found: dict[tuple[Any, ...], Row] = {}
    for path in row_files(folder / "rows"):
        for row in _read(path):
            found.setdefault(tuple(row[key] for key in KEY), row)
    return list(found.values())


def save_table(rows: Sequence[Row], path: Path) -> None:
    """Write rows as one Parquet file; a column that a row lacks is empty there.

    A column whose values are of several kinds, such as a distance or `range`, has them as JSON.

    Raises:
        OutputError: it cannot be written.
    """

    def write(rows: Sequence[Row], file: Path) -> None:
        mixed = _mixed_columns(rows)
        plain = [
            {
                key: json.dumps(value) if key in mixed and value is not None else value
                for key, value in row.items()
            }
            for row in rows
        ]
        table = pa.concat_tables(
            [pa.Table.from_pylist([row]) for row in plain], promote_options="permissive"
        )
        parquet.write_table(table.replace_schema_metadata({MIXED: json.dumps(mixed)}), file)

    save_as(write, rows, path)


def _mixed_columns(rows: Sequence[Row]) -> list[str]:
    """Columns with values of several kinds; Parquet has one type for each column."""
    kinds: dict[str, set[str]] = {}
    for row in rows:
        for key, value in row.items():
            if value is not None:
                kinds.setdefault(key, set()).add(_kind(value))
    return sorted(key for key, those in kinds.items() if len(those) > 1)


def _kind(value: object) -> str:
    match value:
        case bool():
            return "yes or no"
        case Real():
            return "number"
        case str():
            return "text"
        case _:
            return "other"


def row_files(folder: Path) -> list[Path]:
    """The complete files of rows in the folder `rows`, in their order."""
    return sorted(path for path in folder.glob("*.parquet") if path.stem.isdecimal())


def _read(path: Path) -> Iterator[Row]:
    try:
        table = parquet.read_table(path)
    except (OSError, pa.ArrowInvalid) as error:
        remedy = "delete it, and its flights are flown again"
        raise ResultsError(f"{path}: {error}; {remedy}") from error
    mixed = set(json.loads((table.schema.metadata or {}).get(MIXED, b"[]")))
    for row in table.to_pylist():
        yield {
            key: json.loads(value) if key in mixed and value is not None else value
            for key, value in row.items()
            if value is not None or key in KEY
        }

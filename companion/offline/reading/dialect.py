"""How a text of rows and columns is written: by programs, spreadsheets and people of any country.

The header tells what stands between the cells and what around them, by which the names that are
looked for are found. A decimal comma is known by the first number that has one.
"""

import csv
import gzip
import io
import math
import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TextIO

from companion.core.textfile import encoding_of

DELIMITERS = (",", ";", "\t", "|", " ")
QUOTES = ('"', "'")
GZIP_MAGIC = b"\x1f\x8b"
SPREADSHEETS_OWN = re.compile(r"sep=(.)\s*", re.IGNORECASE)
"""A first line by which spreadsheets tell each other the delimiter."""
COMMENT = "#"
MAX_LINES_A_CELL = 20


@dataclass(frozen=True, slots=True)
class TableDialect:
    """What stands between cells, and what around them."""

    delimiter: str
    quote: str

    def cells(self, line: str) -> list[str]:
        """One row."""
        if self.quote in line:
            return self._quoted(line)
        return line.split() if self.delimiter == " " else line.rstrip("\n").split(self.delimiter)

    def _quoted(self, line: str) -> list[str]:
        text = line.strip(" \n") if self.delimiter == " " else line.rstrip("\n")
        rows = csv.reader(
            [text], delimiter=self.delimiter, quotechar=self.quote, skipinitialspace=True
        )
        try:
            return next(rows, [])
        except csv.Error:
            return text.split(self.delimiter)

    def lines(self, file: TextIO) -> Iterator[tuple[int, str]]:
        """The rows' texts from here on and the lines, from 0, on which they begin.

        A row is several lines if a cell is quoted over their ends; but one quote that is never
        closed does not take the rest of the file along.
        """
        opens = re.compile(rf"(?:^|{re.escape(self.delimiter)})\s*{self.quote}")
        waiting: list[str] = []
        number = 0
        while line := waiting.pop(0) if waiting else file.readline():
            taken = [line]
            while _is_open(line, self.quote) and opens.search(line):
                more = waiting.pop(0) if waiting else file.readline()
                taken.append(more)
                line += more
                if not more or len(taken) > MAX_LINES_A_CELL:
                    line, waiting, taken = taken[0], [*filter(None, taken[1:]), *waiting], taken[:1]
                    break
            yield number, line
            number += len(taken)


def _is_open(line: str, quote: str) -> bool:
    return line.count(quote) % 2 == 1


def sniffed(header: str, wanted: Collection[str]) -> tuple[TableDialect, list[str]]:
    """The dialect in which a header has most of the names that are wanted, and all its names."""
    line = header.removeprefix(COMMENT)
    found = [
        (dialect, [name.strip() for name in dialect.cells(line)])
        for dialect in (TableDialect(d, q) for q in QUOTES for d in DELIMITERS)
    ]
    return max(found, key=lambda each: sum(name in wanted for name in each[1]))


def read_header(file: TextIO, wanted: Collection[str]) -> tuple[int, TableDialect, list[str]]:
    """How many lines it took, the dialect, and the columns' names."""
    lines, line = 1, file.readline()
    told = SPREADSHEETS_OWN.fullmatch(line)
    while told or (line.startswith(COMMENT) and not any(name in line for name in wanted)):
        told = None
        lines, line = lines + 1, file.readline()
    return lines, *sniffed(line, wanted)


class Numbers:
    """Numbers of one file, with a point or a comma; NaN for what is none."""

    def __init__(self) -> None:
        self._mark = ""
        """What the first broken number had; another is none."""

    def read(self, cell: str) -> float:
        if "," in cell:
            if self._mark == "." or "." in cell:
                return math.nan
            value = _number(cell.replace(",", ".", 1))
            self._mark = self._mark or ("," if not math.isnan(value) else "")
            return value
        if self._mark == "." or "." not in cell:
            return _number(cell)
        if self._mark == ",":
            return math.nan
        value = _number(cell)
        self._mark = "." if not math.isnan(value) else ""
        return value


def _number(cell: str) -> float:
    """NaN for what is none; Python's own digit separators are none either."""
    try:
        return float(cell) if "_" not in cell else math.nan
    except ValueError:
        return math.nan


@contextmanager
def opened(path: Path) -> Iterator[tuple[TextIO, BinaryIO]]:
    """A text, compressed or not, of whichever encoding; and the file below it, for its place.

    Only names may be of other signs than ASCII, so what cannot be read does not matter.
    """
    with path.open("rb") as raw:
        is_compressed = raw.read(2) == GZIP_MAGIC
        raw.seek(0)
        data = gzip.GzipFile(fileobj=raw) if is_compressed else raw
        begin = data.read(4)
        data.seek(0)
        with io.TextIOWrapper(
            io.BufferedReader(data),
            encoding=_encoding(begin),
            errors="replace",
        ) as text:
            yield text, raw


def _encoding(begin: bytes) -> str:
    if begin[1:2] == b"\0":
        return "utf-16-le" if not begin.startswith(b"\xff\xfe") else "utf-16"
    if begin[:1] == b"\0":
        return "utf-16-be"
    return encoding_of(begin)

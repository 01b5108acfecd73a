"""Detects the dialect of a table: delimiter, quotes, encoding and decimal mark.

Delimiter and quote are those with which the header has the most known names. The decimal mark is
that of the first number with a fraction.
"""

import csv
import gzip
import io
import math
import re
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TextIO

from companion.core.textfile import encoding_of

DELIMITERS = (",", ";", "\t", "|", " ")
"""Possible delimiters."""
QUOTES = ('"', "'")
"""Possible quotes."""
GZIP_MAGIC = b"\x1f\x8b"
"""First bytes of a gzip file."""
SEPARATOR_LINE = re.compile(r'"?sep=.?"?[,;\t|]*', re.IGNORECASE)
"""A line in which spreadsheets declare the delimiter, in quotes or filled with empty cells."""
COMMENT = "#"
"""Prefix of a comment line."""
SPACE = " \t\r\n\f\v\xa0\ufeff"
"""Letters around a name that are not part of it; joined files have byte order marks inside."""
MAX_LINES_PER_CELL = 20
"""Most lines of one quoted cell. Chosen."""


@dataclass(frozen=True, slots=True)
class TableDialect:
    """Delimiter and quote of a table."""

    delimiter: str
    quote: str

    def cells(self, line: str) -> list[str]:
        """Cells of one row."""
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
        """Texts of the rows from here on, with the line numbers, from 0, on which they begin.

        A quoted cell may span several lines. A quote that is never closed does not consume the rest
        of the file.
        """
        opens = re.compile(rf"(?:^|{re.escape(self.delimiter)})\s*{self.quote}")
        pending: list[str] = []
        number = 0
        while line := pending.pop(0) if pending else file.readline():
            taken = [line]
            while _is_open(line, self.quote) and opens.search(line):
                more = pending.pop(0) if pending else file.readline()
                taken.append(more)
                line += more
                if not more or len(taken) > MAX_LINES_PER_CELL:
                    line, pending, taken = taken[0], [*filter(None, taken[1:]), *pending], taken[:1]
                    break
            yield number, line
            number += len(taken)


def _is_open(line: str, quote: str) -> bool:
    return line.count(quote) % 2 == 1


def sniffed(header: str, wanted: Collection[str]) -> tuple[TableDialect, list[str]]:
    """The dialect in which a header has the most wanted names, and all its names."""
    line = header.lstrip(SPACE).removeprefix(COMMENT)
    found = [
        (dialect, [name.strip(SPACE) for name in dialect.cells(line)])
        for dialect in (TableDialect(d, q) for q in QUOTES for d in DELIMITERS)
    ]
    return max(found, key=lambda each: _known(each[1], wanted))


def read_header(file: TextIO, wanted: Collection[str]) -> tuple[int, TableDialect, list[str]]:
    """Number of lines read, the dialect, and the columns' names.

    Empty lines, comments and a spreadsheet's line about its delimiter may come first. A comment may
    be the header itself, or mention columns. Of the comments and the first other line, the one with
    the most wanted names is the header.
    """
    lines, is_comment = 0, True
    header, end, most = (1, *sniffed("", wanted)), 0, -1
    while is_comment and (line := file.readline()):
        lines += 1
        text = line.strip(SPACE)
        is_comment = not text or text.startswith(COMMENT) or bool(SEPARATOR_LINE.fullmatch(text))
        dialect, names = sniffed(line, wanted)
        if text and _known(names, wanted) >= most:
            header, end, most = (lines, dialect, names), file.tell(), _known(names, wanted)
    file.seek(end)
    return header


def _known(names: Sequence[str], wanted: Collection[str]) -> int:
    return sum(name in wanted for name in names)


class Numbers:
    """Parses numbers of one file, with a point or a comma; NaN if invalid."""

    def __init__(self) -> None:
        self._mark = ""
        """Decimal mark of the first fraction; the other one is invalid."""

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
    """NaN if invalid; Python's own digit separators are invalid too."""
    try:
        return float(cell) if "_" not in cell else math.nan
    except ValueError:
        return math.nan


@contextmanager
def opened(path: Path) -> Iterator[tuple[TextIO, BinaryIO]]:
    """Open a text, compressed or not, in any encoding; also returns the raw file, for its position.

    Only names may contain non-ASCII characters, so undecodable bytes do not matter.
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

"""Logs in the dialects of all programs, spreadsheets and countries give the same data."""

import codecs
import csv
import gzip
import io
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from companion.core.errors import LogError
from companion.core.messages import Beam
from companion.offline.reading.log import Log
from companion.offline.reading.readers import read_log
from companion.offline.reading.sensors import load

NAMES = ("time_s", "odom_x_m", "odom_y_m", "odom_yaw_rad", "front_m", "left_m", "note")
ROWS = [
    (0.1 * i, 0.05 * i, -0.25, 0.01 * i, None if i == 3 else 4 - 0.05 * i, 1.5, "at the door")
    for i in range(20)
]


Quoting = Literal[0, 1, 2, 3]


def silent(activity: str, share: float) -> None:
    """Ignores the progress."""


def number(value: object, mark: str = ".") -> str:
    return "" if value is None else str(value).replace(".", mark)


def text(
    delimiter: str = ",",
    *,
    mark: str = ".",
    quoting: Quoting = csv.QUOTE_MINIMAL,
    quote: str = '"',
    end: str = "\n",
) -> str:
    buffer = io.StringIO()
    writer = csv.writer(
        buffer, delimiter=delimiter, quoting=quoting, quotechar=quote, lineterminator=end
    )
    writer.writerow(NAMES)
    writer.writerows([number(value, mark) for value in row] for row in ROWS)
    return buffer.getvalue()


def read(tmp_path: Path, data: bytes, name: str = "flight.csv") -> Log:
    (tmp_path / name).write_bytes(data)
    return read_log(tmp_path / name, silent)


def assert_whole(log: Log) -> None:
    expected = np.array([[math.nan if v is None else v for v in row[:-1]] for row in ROWS], float)
    found = np.column_stack(
        [log.time_s, log.odometry, log.ranges_m[Beam.FRONT], log.ranges_m[Beam.LEFT]]
    )
    np.testing.assert_allclose(found, expected)
    assert log.reading.rows == len(ROWS)
    assert not log.reading.rows_skipped
    assert not log.reading.cells_skipped
    assert log.reading.columns_ignored == ("note",)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("quoting", [csv.QUOTE_MINIMAL, csv.QUOTE_ALL, csv.QUOTE_NONNUMERIC])
@pytest.mark.parametrize(
    ("delimiter", "mark"),
    [(",", "."), (",", ","), (";", "."), (";", ","), ("\t", "."), ("\t", ","), ("|", ".")],
)
def test_every_dialect_gives_the_same_log(
    tmp_path: Path, delimiter: str, mark: str, quoting: Quoting, end: str
) -> None:
    data = text(delimiter, mark=mark, quoting=quoting, end=end).encode()
    assert_whole(read(tmp_path, data))


def test_single_quotes_are_accepted(tmp_path: Path) -> None:
    assert_whole(read(tmp_path, text(quoting=csv.QUOTE_ALL, quote="'").encode()))


def test_columns_may_be_separated_by_spaces(tmp_path: Path) -> None:
    rows = [[*NAMES], *([number(v) or "nan" for v in row[:-1]] + ["x"] for row in ROWS)]
    for widths in ([0] * 7, [12] * 7):
        lines = [" ".join(c.rjust(w) for c, w in zip(row, widths, strict=True)) for row in rows]
        assert_whole(read(tmp_path, "\n".join(lines).encode()))
        assert_whole(read(tmp_path, ("# " + "\n".join(lines)).encode()))


def test_spaces_may_follow_commas(tmp_path: Path) -> None:
    for quoting in (csv.QUOTE_MINIMAL, csv.QUOTE_ALL):
        assert_whole(read(tmp_path, text(quoting=quoting).replace(",", ", ").encode()))


@pytest.mark.parametrize(
    "encode",
    [
        lambda t: codecs.BOM_UTF8 + t.encode(),
        lambda t: t.encode("utf-16"),
        lambda t: t.encode("utf-16-le"),
        lambda t: t.encode("utf-16-be"),
        lambda t: t.replace("at the door", "an der Tür").encode("cp1252"),
        lambda t: t.replace("at the door", "у двери").encode("cp1251"),
        lambda t: gzip.compress(t.encode()),
        lambda t: gzip.compress(t.encode("utf-16")),
    ],
)
def test_every_encoding_gives_the_same_log(tmp_path: Path, encode: Callable[[str], bytes]) -> None:
    assert_whole(read(tmp_path, encode(text(";", mark=",", quoting=csv.QUOTE_ALL, end="\r\n"))))


def test_a_separator_line_and_comments_before_the_header_are_skipped(tmp_path: Path) -> None:
    assert_whole(read(tmp_path, b"sep=;\r\n" + text(";", mark=",").encode()))
    assert_whole(read(tmp_path, b"# recorded by hand\n#\n" + text().encode()))
    log = read(tmp_path, b"# by hand\n" + text().replace("0.1,0.05", "x,0.05").encode())
    (skipped,) = log.reading.rows_skipped.values()
    assert skipped.first.startswith("line 4:")


@pytest.mark.parametrize(
    "before",
    [
        "\n\n",
        '"sep=,"\n',
        "sep=,,,,,\n",
        "\n# by hand\n\n",
        "# time_s is in seconds since boot\n",
        "# front_m, left_m: ranges\n# odom_yaw_rad: clockwise\n",
        "\ufeff",
    ],
)
def test_a_header_is_found_below_other_lines(tmp_path: Path, before: str) -> None:
    assert_whole(read(tmp_path, (before + text()).encode()))
    assert_whole(read(tmp_path, (before + "# " + text()).encode()))
    assert_whole(read(tmp_path, gzip.compress((before + text()).encode("utf-16"))))


def test_empty_cells_at_the_end_of_the_header_are_ignored(tmp_path: Path) -> None:
    head, *rows = text().splitlines()
    assert_whole(read(tmp_path, "\n".join([f"{head},,", *rows]).encode()))
    assert_whole(read(tmp_path, "\n".join([f"{head},,", *(f"{r},unnamed" for r in rows)]).encode()))


def test_empty_cells_at_the_ends_of_rows_are_ignored(tmp_path: Path) -> None:
    head, *rows = text().splitlines()
    assert_whole(read(tmp_path, "\n".join([head, *(f"{row},,," for row in rows)]).encode()))
    assert_whole(read(tmp_path, "\n".join(f"{row},," for row in [head, *rows]).encode()))


def test_notes_may_contain_commas_quotes_and_line_breaks(tmp_path: Path) -> None:
    data = text(quoting=csv.QUOTE_ALL).replace("at the door", 'at ""the""\n door, left')
    assert_whole(read(tmp_path, data.encode()))
    assert_whole(read(tmp_path, text().replace("at the door", '5" tube').encode()))


def test_an_unclosed_quote_drops_one_row(tmp_path: Path) -> None:
    lines = text().splitlines()
    lines[5] = f'"{lines[5]}'
    log = read(tmp_path, "\n".join(lines).encode())
    assert len(log.time_s) == len(ROWS) - 1
    assert log.reading.rows == len(ROWS)


def test_the_sensor_file_of_a_compressed_log_is_found(tmp_path: Path) -> None:
    (tmp_path / "flight.toml").write_text("[sensors]\nsigma_m = 0.03\n")
    assert_whole(read(tmp_path, gzip.compress(text().encode()), "flight.csv.gz"))
    assert load(None, tmp_path / "flight.csv.gz").sigma_m == 0.03


def test_a_truncated_compressed_log_is_refused_in_one_line(tmp_path: Path) -> None:
    whole = gzip.compress(text().encode())
    for data in (whole[:-12], whole[:20], whole[:15] + b"\xff" * 9 + whole[24:]):
        with pytest.raises(LogError, match=r"flight\.csv\.gz: compressed, and cut short or dam"):
            read(tmp_path, data, "flight.csv.gz")


def test_thousands_separators_are_not_read_as_decimal_marks(tmp_path: Path) -> None:
    """A comma and points in one file are ambiguous and are not interpreted."""
    log = read(tmp_path, text(";").replace(";1.5;", ';"1,500";').encode())
    (skipped,) = log.reading.cells_skipped.values()
    assert skipped.count == len(ROWS)
    assert "'1,500'" in skipped.first


CELLS = st.lists(st.text(st.characters(codec="utf-8", exclude_characters="\r\n\0"), max_size=8))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(notes=CELLS, delimiter=st.sampled_from(",;\t|"), mark=st.sampled_from(".,"))
def test_any_text_in_an_ignored_column_is_accepted(
    tmp_path: Path, notes: Sequence[str], delimiter: str, mark: str
) -> None:
    buffer = io.StringIO()
    writer = csv.writer(buffer, delimiter=delimiter, lineterminator="\n")
    writer.writerow(NAMES)
    for i, row in enumerate(ROWS):
        note = notes[i % len(notes)] if notes else ""
        writer.writerow([*(number(value, mark) for value in row[:-1]), note])
    assert_whole(read(tmp_path, buffer.getvalue().encode()))

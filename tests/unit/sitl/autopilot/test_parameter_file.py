"""Tests that parameter files of ground stations are read, and updated without losses."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.autopilot.parameters.file import ParameterFile, beyond_range, parse_assignments
from sitl.autopilot.parameters.table import ParameterError, load_table

TABLE = load_table("ardupilot")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "vehicle.parm"


@pytest.mark.parametrize(
    "line",
    [
        "GUID_TIMEOUT 0.5",
        "GUID_TIMEOUT,0.5",
        "  GUID_TIMEOUT    0.500000   # a comment",
        "1\t1\tGUID_TIMEOUT\t0.500000000000000000\t9",
    ],
)
def test_every_file_format_is_read(path: Path, line: str) -> None:
    path.write_text(f"# Onboard parameters\n\n{line}\n")
    assert ParameterFile(path, TABLE).values == {"GUID_TIMEOUT": 0.5}


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("GUID_TIMEOU 0.5", "no parameter GUID_TIMEOU; did you mean GUID_TIMEOUT"),
        ("GUID_TIMEOUT half", "GUID_TIMEOUT half: not a number"),
        ("GUID_TIMEOUT nan", "GUID_TIMEOUT nan: not a number"),
        ("GUID_TIMEOUT", "'GUID_TIMEOUT' is not a parameter; write NAME VALUE"),
    ],
)
def test_invalid_lines_are_reported_with_their_number(
    path: Path, line: str, complaint: str
) -> None:
    path.write_text(f"# mine\n{line}\n")
    with pytest.raises(ParameterError) as refused:
        ParameterFile(path, TABLE)
    assert f"{path}:2: " in str(refused.value)
    assert complaint in str(refused.value)


def test_a_missing_file_is_created_at_the_first_change(path: Path) -> None:
    file = ParameterFile(path, TABLE)
    assert not path.exists()
    file.keep("GUID_TIMEOUT", TABLE["GUID_TIMEOUT"].fitted(0.3))
    file.keep("LOG_BITMASK", 180222.0)
    assert path.read_text() == "GUID_TIMEOUT 0.3\nLOG_BITMASK 180222\n"


def test_other_contents_of_the_file_are_preserved(path: Path) -> None:
    path.write_text("# mine\n1\t1\tGUID_TIMEOUT\t3\t9\nWPNAV_SPEED,100 # slow\n")
    file = ParameterFile(path, TABLE)
    file.keep("GUID_TIMEOUT", 0.5)
    file.keep("WPNAV_SPEED", 50.0)
    assert path.read_text() == "# mine\n1\t1\tGUID_TIMEOUT\t0.5\t9\nWPNAV_SPEED,50 # slow\n"
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_a_missing_folder_is_refused_at_the_start(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="choose another --params"):
        ParameterFile(tmp_path / "none" / "vehicle.parm", TABLE)


def test_an_unwritable_file_is_reported(path: Path) -> None:
    file = ParameterFile(path, TABLE)
    path.mkdir()
    with pytest.raises(ParameterError, match="cannot be kept"):
        file.keep("GUID_TIMEOUT", 0.5)


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_saved_value_is_read_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, value: float
) -> None:
    path = tmp_path_factory.getbasetemp() / "kept.parm"
    path.unlink(missing_ok=True)
    ParameterFile(path, TABLE).keep("GUID_TIMEOUT", value)
    assert TABLE["GUID_TIMEOUT"].fitted(ParameterFile(path, TABLE).values["GUID_TIMEOUT"]) == value


def test_assignments_are_parsed() -> None:
    assert parse_assignments(["GUID_TIMEOUT=0.5", "ARMING_CHECK=0"], TABLE) == {
        "GUID_TIMEOUT": 0.5,
        "ARMING_CHECK": 0,
    }


@pytest.mark.parametrize("text", ["GUID_TIMEOUT", "GUID_TIMEOUT=", "NO_SUCH=1", "GUID_TIMEOUT=x"])
def test_wrong_assignments_are_refused(text: str) -> None:
    with pytest.raises(ParameterError):
        parse_assignments([text], TABLE)


def test_values_beyond_the_documented_range_are_reported() -> None:
    (warning,) = beyond_range({"GUID_TIMEOUT": 9, "AVOID_MARGIN": 2, "LOG_BITMASK": math.pi}, TABLE)
    assert warning == "GUID_TIMEOUT 9 is outside 0.1 to 5, its documented range"

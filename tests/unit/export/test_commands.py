"""Tests the commands on recordings: replay, export and report."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from sitl.testing import Sitl
from tests.worlds import SMALL_ROOM

pytestmark = pytest.mark.flights


def companion(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "companion", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    Sitl(folder).fly(SMALL_ROOM, record=folder)
    (path,) = folder.glob("*.mcap")
    return path


@pytest.fixture(params=["whole", "cut short"])
def any_recording(request: pytest.FixtureRequest, recording: Path, tmp_path: Path) -> Path:
    if request.param == "whole":
        return recording
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(recording.read_bytes()[:700_000])
    return cut


def test_the_commands_accept_whole_and_truncated_recordings(
    any_recording: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    replayed = companion("replay", any_recording, "--out", out)
    assert replayed.returncode == 0, replayed.stderr
    assert {"map.json", "map.png", "map.ply"} <= {path.name for path in out.iterdir()}
    done = companion("export", any_recording, "--format", "dxf", "--format", "json", "--out", out)
    assert done.returncode == 0, done.stderr
    assert [Path(line).suffix for line in done.stdout.split()] == [".dxf", ".json"]
    reported = companion("report", any_recording, "--out", out / "report.html")
    assert reported.returncode == 0, reported.stderr
    page = (out / "report.html").read_text()
    assert page.count("<svg") == 3
    assert not re.search(r'(src|href)="(?!#|data:)', page)


def test_the_report_contains_result_phases_rooms_and_faults(
    recording: Path, tmp_path: Path
) -> None:
    path = tmp_path / "report.html"
    companion("report", recording, "--out", path)
    page = path.read_text()
    for text in (
        "mission complete",
        "scanning parallel to the wall",
        "room 1",
        "no faults",
    ):
        assert text in page


@pytest.mark.parametrize("command", ["replay", "report", "export"])
def test_a_file_that_is_not_a_recording_is_a_one_line_error(command: str, tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    path.write_text("no")
    options = ["--format", "dxf"] if command == "export" else []
    refused = companion(command, path, *options)
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert "not a recording" in refused.stderr


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--format", "geojson"], "give --lat-deg and --lon-deg, or set link.origin_lat_deg"),
        (["--format", "geojson", "--lat-deg", "47"], "a place needs both --lat-deg and --lon-deg"),
        (["--format", "geojson", "--lat-deg", "nan", "--lon-deg", "8"], "less than or equal to 90"),
        (["--format", "geojson", "--lat-deg", "50", "--lon-deg", "800"], "equal to 180"),
        (["--format", "svg", "--up", "north"], "--up north needs the true heading"),
    ],
)
def test_what_only_the_user_can_know_is_asked_for(
    recording: Path, tmp_path: Path, options: list[str], said: str
) -> None:
    refused = companion("export", recording, *options, "--out", tmp_path)
    assert refused.returncode
    assert said in " ".join(refused.stderr.replace("│", " ").split())
    assert not list(tmp_path.iterdir())


def test_a_title_that_cannot_be_drawn_is_refused(recording: Path, tmp_path: Path) -> None:
    options = "--format", "svg", "--out", tmp_path, "--title", "Flat\n3"
    refused = companion("export", recording, *options)
    assert refused.returncode == 2
    assert "contains a control character" in " ".join(refused.stderr.replace("│", " ").split())
    assert not list(tmp_path.iterdir())


def test_a_sheet_is_made_as_asked_for(recording: Path, tmp_path: Path) -> None:
    names = tmp_path / "names.toml"
    names.write_text('"room 1" = "Kitchen"\n')
    drawn = companion(
        *("export", recording, "--format", "svg", "--out", tmp_path, "--title", "Flat 3"),
        *("--rooms", names, "--no-path", "--no-points", "--up", "take-off"),
    )
    assert drawn.returncode == 0, drawn.stderr
    (sheet,) = tmp_path.glob("*.svg")
    text = sheet.read_text(encoding="utf-8")
    assert re.search(r"Flat 3, \d{4}-\d\d-\d\d", text)
    assert "Kitchen" in text
    assert "INCOMPLETE" not in text


def test_a_missing_extra_is_named_in_one_line(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ezdxf.py").write_text("raise ModuleNotFoundError('gone', name='ezdxf')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    refused = companion("export", recording, "--format", "dxf", "--out", tmp_path / "out")
    assert refused.returncode == 2
    assert "pip install 'pdps-companion[export]'" in refused.stderr
    assert refused.stderr.count("\n") == 1

"""Tests of several flights merged into one map."""

import json
import math
import re
import subprocess
import sys
from pathlib import Path

import pytest

from sitl.testing import Sitl

pytestmark = pytest.mark.flights

ROOM = """
name = "L-shaped room"
height_m = 2.6
walls = [{{ points = [[0, 0], [7, 0], [7, 4.5], [4.5, 4.5], [4.5, 6], [0, 6]], closed = true }}]
starts = [{{ name = "pad", position = [{east}, {north}], heading_deg = {heading} }}]
"""
FRAMES_APART_CM = 6
"""Standard deviation of one flight's take-off place in another's frame, cm: each knows its own to
4 cm, because the odometry wanders before the first wall is measured."""
PAD = 2.5, 2.5, 20.0
"""Start of the first flight: east and north, m, and heading, °."""


def record(folder: Path, seed: int, east: float, north: float, heading: float) -> Path:
    """Fly, and return the recording."""
    folder.mkdir()
    (folder / "room.toml").write_text(ROOM.format(east=east, north=north, heading=heading))
    Sitl(folder).fly(str(folder / "room.toml"), seed=seed, record=folder)
    (path,) = folder.glob("*.mcap")
    return path


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two flights from the same pad, the second 6 cm and 4° off it, and one from elsewhere."""
    folder = tmp_path_factory.mktemp("merge")
    east, north, heading = PAD
    return [
        record(folder / "first", 1, east, north, heading),
        record(folder / "second", 2, east + 0.05, north - 0.04, heading + 4),
        record(folder / "elsewhere", 3, east + 1.5, north - 0.5, heading + 120),
    ]


def merge(out: Path, *flights: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "companion", "merge", *map(str, flights), "--out", str(out)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


def test_flights_from_the_same_pad_make_one_map(recordings: list[Path], tmp_path: Path) -> None:
    merged = merge(tmp_path, *recordings[:2])
    assert merged.returncode == 0, merged.stderr
    walls = json.loads((tmp_path / "map.json").read_text())["walls"]
    lengths_m = sorted(math.dist(wall["start_ne_m"], wall["end_ne_m"]) for wall in walls)
    assert lengths_m == pytest.approx([1.5, 2.5, 4.5, 4.5, 6.0, 7.0], abs=0.1)
    off_cm, off_deg = re.findall(r"(\d+) cm +│ ([+-][\d.]+)°", merged.stdout)[1]
    assert float(off_cm) == pytest.approx(6.4, abs=FRAMES_APART_CM)
    assert float(off_deg) == pytest.approx(4, abs=2)


def test_a_flight_from_elsewhere_is_left_out(recordings: list[Path], tmp_path: Path) -> None:
    merged = merge(tmp_path, recordings[0], recordings[2], recordings[1])
    assert merged.returncode == 1, merged.stderr
    assert f"left out: {recordings[2].name}" in merged.stdout
    assert len(json.loads((tmp_path / "map.json").read_text())["walls"]) == 6


def test_a_recording_named_twice_is_refused(recordings: list[Path], tmp_path: Path) -> None:
    refused = merge(tmp_path, recordings[0], recordings[0])
    assert refused.returncode == 2
    assert "named twice" in refused.stderr
    assert refused.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())

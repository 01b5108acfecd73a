"""Tests of several flights merged into one map."""

import json
import math
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from companion.config.range_sensors import Calibration
from companion.config.settings import Config, SensorsConfig
from companion.core.arrays import Array
from companion.core.errors import SurveyError
from companion.core.frames import ned_to_frd, wrap_rad
from companion.core.messages import Beam
from companion.recording.reader import Recording, read
from companion.survey import start_search
from companion.survey.evidence import Sight
from companion.survey.flights import Flown
from companion.survey.folder import check_same_sensors
from companion.survey.known_start import solved_from_pad
from companion.survey.solved import keep, kept_or_solved
from companion.survey.start_search import Placing
from companion.survey.unknown_start import StartSearch, is_same, search_start
from sitl.testing import Sitl
from tests.unit.survey.rooms import L_SHAPE, RECTANGLE, Corners

pytestmark = pytest.mark.flights

ROOM = """
name = "L-shaped room"
height_m = 2.6
walls = [{{ points = {corners}, closed = true }}]
starts = [{{ name = "pad", position = [{north}, {east}], heading_deg = {heading} }}]
"""
FRAMES_APART_CM = 6
"""Standard deviation of one flight's take-off place in another's frame, cm: each knows its own to
4 cm, because the odometry wanders before the first wall is measured."""
PAD = 2.5, 2.5, 20.0
"""Start of the first flight: north and east, m, and heading, °."""
ELSEWHERE = 4.0, 2.0, 140.0
"""Start of the third."""


def record(  # noqa: PLR0917 - a start is three numbers
    folder: Path,
    seed: int,
    north: float,
    east: float,
    heading: float,
    corners: Corners = L_SHAPE,
) -> Path:
    """Fly, and return the recording. The solved flight is kept for merges into the parent."""
    folder.mkdir()
    corners_toml = [list(corner) for corner in corners]
    text = ROOM.format(corners=corners_toml, east=east, north=north, heading=heading)
    (folder / "room.toml").write_text(text)
    flight = Sitl(folder).fly(str(folder / "room.toml"), seed=seed, record=folder)
    (path,) = folder.glob("*.mcap")
    keep(Flown.of(path.name, flight.app), path, folder.parent)
    return path


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two flights from the same pad, the second 6 cm and 4° off it, and one from elsewhere."""
    folder = tmp_path_factory.mktemp("merge")
    north, east, heading = PAD
    return [
        record(folder / "first", 1, east, north, heading),
        record(folder / "second", 2, north + 0.05, east - 0.04, heading + 4),
        record(folder / "elsewhere", 3, *ELSEWHERE),
    ]


@pytest.fixture(scope="module")
def in_a_rectangle(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two flights from different places in a rectangular room."""
    folder = tmp_path_factory.mktemp("rectangle")
    return [
        record(folder / "first", 1, *PAD, RECTANGLE),
        record(folder / "elsewhere", 3, *ELSEWHERE, RECTANGLE),
    ]


@pytest.fixture
def out(recordings: list[Path]) -> Path:
    """Folder for merged maps that contains the solved flights."""
    return recordings[0].parent.parent


def in_first(start: tuple[float, float, float]) -> Array:
    """(3,): a start, with its heading in °, in the frame of the flight from the pad."""
    (north, east, heading), yaw = start, math.radians(PAD[2])
    north_m, east_m = ned_to_frd(north - PAD[0], east - PAD[1], yaw)
    return np.array([north_m, east_m, wrap_rad(math.radians(heading) - yaw)])


def merge(
    out: Path, *flights: Path, options: Sequence[str] = ()
) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "companion", "merge", *map(str, flights), "--out", str(out)]
    command += options
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


def test_flights_from_the_same_pad_make_one_map(recordings: list[Path], out: Path) -> None:
    merged = merge(out, *recordings[:2])
    assert merged.returncode == 0, merged.stderr
    walls = json.loads((out / "map.json").read_text())["walls"]
    lengths_m = sorted(math.dist(wall["start_ne_m"], wall["end_ne_m"]) for wall in walls)
    assert lengths_m == pytest.approx([1.5, 2.5, 4.5, 4.5, 6.0, 7.0], abs=0.1)
    off_cm, off_deg = re.findall(r"(\d+) cm +│ ([+-][\d.]+)°", merged.stdout)[1]
    assert float(off_cm) == pytest.approx(6.4, abs=FRAMES_APART_CM)
    assert float(off_deg) == pytest.approx(4, abs=2)


def test_a_flight_from_elsewhere_is_left_out(recordings: list[Path], out: Path) -> None:
    merged = merge(out, recordings[0], recordings[2], recordings[1])
    assert merged.returncode == 1, merged.stderr
    assert f"left out: {recordings[2].name}" in merged.stdout
    assert len(json.loads((out / "map.json").read_text())["walls"]) == 6


def test_a_recording_named_twice_is_refused(recordings: list[Path], tmp_path: Path) -> None:
    refused = merge(tmp_path, recordings[0], recordings[0])
    assert refused.returncode == 2
    assert "named twice" in refused.stderr
    assert refused.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_two_recordings_of_one_name_are_refused(recordings: list[Path], tmp_path: Path) -> None:
    copy = tmp_path / recordings[0].name
    copy.write_bytes(recordings[1].read_bytes())
    refused = merge(tmp_path / "out", recordings[0], copy)
    assert refused.returncode == 2
    assert "another recording has this name" in refused.stderr


def test_drones_may_differ_in_wiring_and_calibration_but_not_in_their_sensors() -> None:
    calibration = {Beam.FRONT: Calibration(gain=1.02)}
    other_wires = SensorsConfig(bus="sitl://127.0.0.1:5791", calibration=calibration)
    other_kind = SensorsConfig(profile="tf_luna")
    first, like_it, unlike = (
        Recording(Path(f"{number}.mcap"), Config(sensors=sensors))
        for number, sensors in enumerate((SensorsConfig(), other_wires, other_kind))
    )
    check_same_sensors([first, like_it])
    with pytest.raises(SurveyError, match=r"2\.mcap: \[sensors\] differs from that of 0\.mcap"):
        check_same_sensors([first, like_it, unlike])


UNKNOWN = ("--starts", "unknown")


def began(printed: str) -> Array:
    """(3,): where the second flight of a merged map began."""
    numbers = re.findall(r"([+-][\d.]+) m +│ ([+-][\d.]+) m +│ ([+-][\d.]+)°", printed)[1]
    north_m, east_m, heading_deg = map(float, numbers)
    return np.array([north_m, east_m, math.radians(heading_deg)])


def test_an_unknown_start_is_found(recordings: list[Path], out: Path) -> None:
    merged = merge(out, recordings[0], recordings[2], options=UNKNOWN)
    assert merged.returncode == 0, merged.stderr
    assert began(merged.stdout) == pytest.approx(in_first(ELSEWHERE), abs=0.15)
    assert len(json.loads((out / "map.json").read_text())["walls"]) == 6


def test_an_ambiguous_start_is_said_with_its_candidates_and_can_be_given(
    in_a_rectangle: list[Path], tmp_path: Path
) -> None:
    ambiguous = merge(tmp_path, *in_a_rectangle, options=UNKNOWN)
    assert ambiguous.returncode == 1, ambiguous.stderr
    assert ambiguous.stdout.count("solving flight") == 2
    said = " ".join(ambiguous.stdout.split())
    assert f"left out: {in_a_rectangle[1].name}: 2 starts fit equally: " in said
    north_m, east_m, yaw_rad = in_first(ELSEWHERE).tolist()
    named = [
        (float(heading), float(north) * (1 if way == "north" else -1))
        for north, way, heading in re.findall(r"([\d.]+) m (north|south),.*?([+-]\d+)°", said)
    ]
    assert any(
        heading == pytest.approx(math.degrees(yaw_rad), abs=3)
        and north == pytest.approx(north_m, abs=0.3)
        for heading, north in named
    )
    start = f"{in_a_rectangle[1].name}={north_m:.2f},{east_m:.2f},{math.degrees(yaw_rad):.0f}"
    resolved = merge(tmp_path, *in_a_rectangle, options=[*UNKNOWN, "--start", start])
    assert resolved.returncode == 0, resolved.stdout + resolved.stderr
    assert "solving flight" not in resolved.stdout
    assert len(json.loads((tmp_path / "map.json").read_text())["walls"]) == 4


@pytest.mark.parametrize(
    ("start", "complaint"),
    [
        ("{first}=1,2,3", "is the first flight"),
        ("unknown.mcap=1,2,3", "no flight of this name"),
        ("1,2,3", "no flight of this name"),
        ("{second}=1,2", "write three numbers"),
        ("{second}=1,nan,2", "must be finite"),
    ],
)
def test_a_wrong_start_is_refused(
    recordings: list[Path], tmp_path: Path, start: str, complaint: str
) -> None:
    text = start.format(first=recordings[0].name, second=recordings[1].name)
    refused = merge(tmp_path, *recordings[:2], options=["--start", text])
    assert refused.returncode == 2
    assert complaint in refused.stderr
    assert refused.stderr.count("\n") == 1


@pytest.mark.parametrize("wrong", [1, 2])
def test_a_wrong_alignment_is_undone(
    recordings: list[Path], out: Path, monkeypatch: pytest.MonkeyPatch, wrong: int
) -> None:
    first, elsewhere = (kept_or_solved(read(recordings[each]), out) for each in (0, 2))
    searches: list[StartSearch] = []

    def wrong_at_first(flight: Sight, known: Sight, refuted: Sequence[Array] = ()) -> StartSearch:
        """As if the first search had been sure of a wrong start."""
        search = search_start(flight, known, refuted)
        searches.append(search)
        if len(searches) > 1:
            return search
        sure = replace(search.candidates[wrong], contradicted_m=0.0, shared_walls=6)
        return StartSearch((sure,))

    monkeypatch.setattr(start_search, "search_start", wrong_at_first)
    joint, _ = solved_from_pad([first], np.full(3, 0.05), {})
    joint, left_out = Placing(joint, [elsewhere]).run()
    assert len(searches) > 2
    assert not left_out
    assert not is_same(joint.start(1), searches[0].candidates[wrong].start)
    assert is_same(joint.start(1), in_first(ELSEWHERE))

"""Tests of a survey: several flights with short batteries, one map that grows."""

import json
import math
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from companion.app import App
from companion.core.errors import SurveyError
from companion.recording.reader import read
from companion.recording.replay import is_same_map, replay
from companion.survey.folder import Survey
from companion.survey.solved import kept_at, kept_or_solved
from sitl.testing import Sitl
from tests.worlds import SMALL_ROOM, TWO_ROOMS

pytestmark = pytest.mark.flights

BATTERY_S = 120
"""Too short for both rooms."""


def run(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", program, *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=280,
    )


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a survey of up to four flights."""
    folder = tmp_path_factory.mktemp("survey")
    (folder / "world.toml").write_text(TWO_ROOMS)
    sorties = f"--sorties=4 --battery-s={BATTERY_S} --mission=building --seed=2".split()
    world, out = folder / "world.toml", folder / "survey"
    done = run("sitl", "fly", str(world), *sorties, f"--out={out}")
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def test_a_later_flight_flies_what_the_earlier_ones_left(flown: Path) -> None:
    report = json.loads((flown / "report.json").read_text())
    sorties = report["sorties"]
    assert 2 <= len(sorties) <= 4
    assert not sorties[0]["completed"]
    assert sorties[-1]["completed"]
    assert sorties[-1]["coverage"] > 0.95
    assert report["collisions"] == 0
    assert report["changes"] == []
    assert report["wall_error_aligned_cm"] < 4
    assert report["flight_time_s"] == pytest.approx(sum(row["flight_time_s"] for row in sorties))
    for row in sorties:
        assert row["flight_time_s"] < BATTERY_S
        assert row["return_m"] < 0.3


def test_every_flight_replays_to_the_bit_without_the_others(flown: Path, tmp_path: Path) -> None:
    for file in flown.glob("*.mcap"):
        alone = Path(shutil.copy(file, tmp_path))
        recording = read(alone)
        assert is_same_map(replay(recording), recording)


def test_the_folder_alone_makes_the_map_and_says_what_is_left(flown: Path, tmp_path: Path) -> None:
    folder = tmp_path / "survey"
    shutil.copytree(flown, folder)
    status = run("companion", "survey", str(folder))
    assert status.returncode == 0, status.stdout + status.stderr
    assert "nothing that can be reached is left" in status.stdout
    merged = json.loads((folder / "survey.json").read_text())["merged"]
    assert merged == sorted(file.name for file in folder.glob("*.mcap"))

    reported = run("companion", "survey", str(folder), "report")
    assert reported.returncode == 0, reported.stdout + reported.stderr
    assert "solving flight" not in reported.stdout
    page = (folder / "survey.html").read_text()
    for name in merged:
        assert name in page
    assert "nothing has changed" in page
    assert page.count("<svg") == 1

    for file in sorted(folder.glob("*.mcap"))[1:]:
        file.unlink()
    status = run("companion", "survey", str(folder), "status")
    assert status.returncode == 1, status.stdout + status.stderr
    assert "places to look from" in status.stdout


def test_what_the_next_flight_knows_is_kept_until_a_flight_is_added_or_removed(
    flown: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "survey"
    shutil.copytree(flown, folder)
    files = sorted(folder.glob("*.mcap"))
    for file in files[2:]:
        file.unlink()
    told: list[str] = []
    first = Survey(folder, told.append).earlier()
    assert told == ["solving 2 flights together"]
    told.clear()
    again = Survey(folder, told.append).earlier()
    assert not told
    assert first is not None
    assert again is not None
    assert again.to_bytes() == first.to_bytes()
    config = read(files[1]).config
    shown = App(config, first).sketch().earlier_walls
    mapped = json.loads((folder / "map.json").read_text())["walls"]
    lengths_m = [math.dist(wall["start_ne_m"], wall["end_ne_m"]) for wall in mapped]
    assert sum(wall.length_m for wall in shown) > 0.9 * sum(lengths_m)
    assert all(wall.sigma_m < 0.1 for wall in shown if wall.length_m > 2)
    (folder / "earlier.npz").write_bytes(b"damaged")
    assert Survey(folder, told.append).earlier() is not None
    assert "is made again" in told[0]


def test_a_flight_is_solved_once(tmp_path: Path) -> None:
    """A damaged or outdated file is replaced."""
    Sitl(tmp_path).fly(SMALL_ROOM, record=tmp_path)
    (file,) = tmp_path.glob("*.mcap")
    recording = read(file)
    first = kept_or_solved(recording, tmp_path)
    kept = kept_at(file, tmp_path)
    again, made_at = kept_or_solved(recording, tmp_path), kept.stat().st_mtime_ns
    for name in ("poses", "walls", "reach_m", "calibration"):
        assert np.array_equal(getattr(again.x, name), getattr(first.x, name))
    assert np.array_equal(again.wall_of, first.wall_of)
    for name in ("rays", "overhead", "heights"):
        assert np.array_equal(getattr(again, name), getattr(first, name)), name
    for name in ("tried", "ceiling_m", "explained"):
        assert getattr(again, name) == getattr(first, name), name
    assert again.models.odometry == first.models.odometry
    assert np.array_equal(again.m.distance_m, first.m.distance_m)
    assert kept.stat().st_mtime_ns == made_at
    kept.write_bytes(b"damaged")
    assert np.array_equal(kept_or_solved(recording, tmp_path).x.poses, first.x.poses)
    assert kept.stat().st_mtime_ns > made_at


def test_a_survey_without_flights_and_a_damaged_index_are_refused(tmp_path: Path) -> None:
    refused = run("companion", "survey", str(tmp_path))
    assert refused.returncode == 2
    assert "companion fly --survey" in refused.stderr
    (tmp_path / "survey.json").write_text('{"pad": {"sigma_m": -1}}')
    with pytest.raises(SurveyError, match=r"survey\.json: pad\.sigma_m: .*greater than 0"):
        Survey(tmp_path, print)
    for data, said in (
        (b'{"pad": ', "Invalid JSON"),
        ('"Küche"'.encode("latin-1"), "line 1: byte 0xfc is not UTF-8"),
    ):
        (tmp_path / "survey.json").write_bytes(data)
        with pytest.raises(SurveyError, match=rf"survey\.json: {said}"):
            Survey(tmp_path, print)


def test_a_survey_that_cannot_be_made_is_refused_before_take_off(tmp_path: Path) -> None:
    config = tmp_path / "companion.toml"
    config.write_text("[recording]\nenabled = false\n")
    refused = run("companion", "fly", f"--config={config}", f"--survey={tmp_path / 'survey'}")
    assert refused.returncode == 2, refused.stdout + refused.stderr
    assert "set it to true" in refused.stderr
    assert not (tmp_path / "survey").exists()

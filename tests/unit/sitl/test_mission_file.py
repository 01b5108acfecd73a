"""Tests of mission files: settings and events, or an error of one line."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from sitl.commands.cli import commands
from sitl.testing import Sitl
from sitl.testing.mission_file import MissionError, load_mission

pytestmark = pytest.mark.flights

GOOD = """
[mission]
speed_m_s = 0.7

[[events]]
when = "scanning"
do = "pilot_mode"
with = "LOITER"
"""


def written(folder: Path, name: str, text: str) -> str:
    path = folder / name
    path.write_text(text)
    return str(path)


def test_a_mission_kind_loads_as_a_mission() -> None:
    assert load_mission("room").settings == {"mission.kind": "room"}


def test_a_file_sets_mission_and_events(tmp_path: Path, sitl: Sitl) -> None:
    flight = sitl.fly("room_100", mission=written(tmp_path, "careful.toml", GOOD))
    assert flight.config.mission.speed_m_s == 0.7
    assert flight.ending == "handed over: mode changed to LOITER"


def test_a_python_file_sets_mission_and_events(tmp_path: Path) -> None:
    text = (
        "from sitl.testing import at, crash\nmission = {'height_m': 1}\nevents = [at(9, crash())]"
    )
    mission = load_mission(written(tmp_path, "mission.py", text))
    assert mission.settings == {"mission.height_m": 1}
    assert len(mission.events) == 1


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[mission", "not TOML"),
        ("[[events]]\ndo = 'crash'", "either at_s or when"),
        ("[[events]]\nat_s = -1\ndo = 'crash'", "at_s = -1"),
        ("[[events]]\nat_s = 1\ndo = 'explode'", "no action 'explode'"),
        ("[[events]]\nat_s = 1\ndo = 'unplug'", "unplug: beam"),
        ("[[events]]\nat_s = 1\ndo = 'crash'\nfor_s = 3", "crash: for_s"),
        ("[[events]]\nat_s = 1\ndo = 'bad_link'\nwith = { loss = 'x' }", "bad_link: loss"),
        ("[[events]]\nat_s = 1\ndo = 'unplug'\nwith = 'rear'", "'rear'"),
        ("[[events]]\nat_s = 1\ndo = 'pilot_mode'\nwith = 'SLEEP'", "'SLEEP'"),
        ("[colour]\nred = 1", "no such key"),
    ],
)
def test_invalid_files_raise_a_one_line_error(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(MissionError, match=complaint) as refused:
        load_mission(written(tmp_path, "bad.toml", text))
    assert "\n" not in str(refused.value)


def test_a_missing_file_is_reported() -> None:
    with pytest.raises(MissionError, match="No such file"):
        load_mission("nowhere.toml")


@pytest.mark.parametrize(
    "text",
    [
        "mission = 1",
        "mission = {}\nevents = ['crash']",
        "mission = {}\nevents = 3",
        "from sitl.testing import at, crash\nmission = {}\nevents = (at(1, crash()) for _ in '1')",
        "raise ValueError('x')",
        "raise SystemExit(3)",
        "(",
    ],
)
def test_a_python_file_without_a_mission_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(MissionError):
        load_mission(written(tmp_path, "bad.py", text))


@pytest.mark.parametrize("name", ["mission.toml", "MISSION.TOML"])
def test_a_setting_of_the_mission_that_is_refused_is_told_with_the_missions_file(
    tmp_path: Path, name: str
) -> None:
    mission = written(tmp_path, name, "[mission]\nspeed_m_s = 9\n")
    (tmp_path / "drone.toml").write_text("[mission]\nheight_m = 1.0\n")
    for options in ((), ("--config", str(tmp_path / "drone.toml"))):
        refused = CliRunner().invoke(commands, ["fly", "room_100", "--mission", mission, *options])
        assert str(refused.exception).startswith(f"{mission}: mission.speed_m_s = 9: should be")

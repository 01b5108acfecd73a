"""Tests that a flight fails if its scripted events do not happen."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.app import App
from sitl.commands.cli import commands
from sitl.core.errors import SitlError
from sitl.simulation.simulation import Simulation
from sitl.testing import Event, Sitl, at, crash, gust, optional, watch, when
from tests.worlds import SMALL_ROOM

ENDS_SOON = {"mission.time_limit_s": 5}
NEVER = 900.0


@pytest.mark.parametrize(
    ("event", "name"),
    [
        (at(NEVER, crash()), "at 900 s"),
        (when("scaning", crash()), "when 'scaning'"),
        (Event(lambda simulation, app: False, crash()), "an Event of its own"),
    ],
)
def test_an_event_that_never_happens_fails_the_test(sitl: Sitl, event: Event, name: str) -> None:
    happens = at(1, gust(0.1, 0, for_s=0.1))
    with pytest.raises(AssertionError) as failed:
        sitl.fly(SMALL_ROOM, script=[happens, event], settings=ENDS_SOON)
    assert f"before these events: {name}; use optional" in str(failed.value)


def test_an_optional_event_and_a_watch_need_not_happen(sitl: Sitl) -> None:
    times_s: list[float] = []

    def note(simulation: Simulation, app: App) -> None:
        times_s.append(simulation.time_s)

    script = [optional(at(NEVER, crash())), watch(note)]
    sitl.fly(SMALL_ROOM, script=script, settings=ENDS_SOON)
    assert len(times_s) > 100
    assert times_s == sorted(times_s)


MISSION = """
[mission]
time_limit_s = 5

[[events]]
at_s = 900
do = "crash"
"""


def test_an_event_of_a_mission_file_that_never_happens_fails_the_flight(
    sitl: Sitl, tmp_path: Path
) -> None:
    path = tmp_path / "mission.toml"
    path.write_text(MISSION)
    with pytest.raises(AssertionError, match="at 900 s"):
        sitl.fly(SMALL_ROOM, mission=str(path))
    ended = CliRunner().invoke(commands, ["fly", SMALL_ROOM, "--mission", str(path)])
    assert isinstance(ended.exception, SitlError)
    assert "the flight ended before these events: at 900 s" in str(ended.exception)
    assert "coverage" in ended.output
    benched = CliRunner().invoke(
        commands,
        ["bench", "missions", "--worlds", SMALL_ROOM, "--mission", str(path), "--json"],
    )
    assert "before these events: at 900 s" in benched.output
    assert json.loads(benched.stdout)["rows"][0]["completed"] is False
    path.write_text(MISSION + "optional = true\n")
    sitl.fly(SMALL_ROOM, mission=str(path))

"""`companion fly --rehearse` at the terminal: what it shows, stores, and leaves behind."""

import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
import typer
from rich.console import Console

from companion.bringup import rehearse as runner
from companion.bringup.findings import CheckResult, Finding
from companion.bringup.rehearse import Opened, play, rehearse
from companion.commands import fly
from companion.config.settings import Config
from companion.core.errors import OutputError, RehearsalError
from companion.link.transports.transport import direct_pair
from companion.recording import room
from companion.run.preflight.rehearsed import passed_now, store, valid_pass
from sitl.autopilot.firmware import Throttle
from sitl.simulation.lockstep import LockstepClock
from sitl.simulation.simulation import Setup, Simulation
from sitl.world.loading import load_world
from tests.deployed import loaded

ALT_HOLD, LOITER = 2, 5


def simulated(tmp_path: Path) -> tuple[Config, Simulation, Opened]:
    pass_file = {"rehearsal_file": str(tmp_path / "state" / "rehearsal.json")}
    config = Config.model_validate({"preflight": pass_file})
    world, parameters = load_world("room_100"), loaded("ardupilot")
    setup = Setup(world, "room_100", 1, config.sensors, parameters=parameters)
    sitl_end, companion_end = direct_pair(setup.system_id)
    simulation = Simulation(setup, [sitl_end])
    simulation.autopilot.switch_transmitter(on=True)
    simulation.autopilot.pilot_mode(ALT_HOLD, Throttle.MID)
    clock = LockstepClock(simulation, lambda: None)
    return config, simulation, Opened(config, companion_end, simulation.board.bus, clock, tmp_path)


def pilot_of(simulation: Simulation, shown: list[Finding]) -> runner.Show:
    def show(lines: Sequence[Finding], prompt: str) -> None:
        shown.extend(lines)
        if prompt:
            mode = LOITER if "take the drone" in prompt else ALT_HOLD
            simulation.autopilot.pilot_mode(mode, Throttle.MID)

    return show


def test_a_passed_rehearsal_shows_every_line_once_and_leaves_no_recording(tmp_path: Path) -> None:
    _, simulation, opened = simulated(tmp_path)
    shown: list[Finding] = []
    lines, autopilot = play(opened, pilot_of(simulation, shown))
    assert shown == lines
    assert {line.verdict for line in lines} == {CheckResult.GOOD}
    assert {"bus", "front", "arm", "disarm", "recording", "computer", "version"} <= {
        line.part for line in lines
    }
    assert autopilot == "version 4.6.3, source 0, board 0"
    assert list(tmp_path.iterdir()) == []


def test_a_recording_that_cannot_be_written_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, simulation, opened = simulated(tmp_path)
    monkeypatch.setattr("companion.recording.disk.MIN_FREE_BYTES", 1 << 60)
    monkeypatch.setattr("companion.recording.disk.SYNC_PERIOD_S", 0.0)
    lines, _ = play(opened, pilot_of(simulation, []))
    (recording,) = (line for line in lines if line.part == "recording")
    assert recording.verdict is CheckResult.BAD
    assert "reserved for the map" in recording.seen
    assert "another card" in recording.remedy


@pytest.fixture
def console() -> Iterator[Console]:
    with Path("/dev/null").open("w") as nowhere:
        yield Console(record=True, width=200, file=nowhere)


def answers(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr(Console, "input", lambda *_: text)


def test_nothing_is_opened_before_the_propellers_are_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, console: Console
) -> None:
    config, _, _ = simulated(tmp_path)
    answers(monkeypatch, "no")
    monkeypatch.setattr(runner, "open_transport", lambda *_: pytest.fail("opened"))
    assert not rehearse(config, tmp_path, console)
    assert "no flight is allowed" in console.export_text()


def test_a_card_without_room_is_told_before_anything_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, console: Console
) -> None:
    config, _, _ = simulated(tmp_path)
    monkeypatch.setattr(room, "MIN_FREE_BYTES", 1 << 60)
    monkeypatch.setattr(Console, "input", lambda *_: pytest.fail("asked"))
    assert not rehearse(config, tmp_path, console)
    assert "free some space" in console.export_text()


@pytest.mark.parametrize(("passes", "status"), [(True, 0), (False, 1)])
def test_the_command_rehearses_instead_of_flying(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, passes: bool, status: int
) -> None:
    monkeypatch.setattr(fly, "rehearse", lambda *_: passes)
    monkeypatch.setattr(fly, "open_rig", lambda *_, **__: pytest.fail("flown"))
    with pytest.raises(typer.Exit) as ended:
        fly.fly_command(out=tmp_path, is_rehearsal=True)
    assert ended.value.exit_code == status


def test_only_the_option_skips_the_rehearsal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[bool] = []

    def open_rig(*_: object, skip_rehearsal: bool) -> None:
        asked.append(skip_rehearsal)
        raise RehearsalError("no rehearsal")

    monkeypatch.setattr(fly, "open_rig", open_rig)
    for skips in (False, True):
        with pytest.raises(RehearsalError):
            fly.fly_command(out=tmp_path, skip_rehearsal=skips)
    assert asked == [False, True]


def test_a_new_rehearsal_ends_the_pass_of_the_last_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, console: Console
) -> None:
    config, _, _ = simulated(tmp_path)
    store(config.preflight.rehearsal_file, passed_now(config, "version 4.6.3", ()))
    assert valid_pass(config, time.time())
    answers(monkeypatch, "no")
    rehearse(config, tmp_path, console)
    assert not config.preflight.rehearsal_file.exists()


def test_a_pass_that_cannot_be_stored_names_its_key(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=r"preflight\.rehearsal_file = .*may write"):
        store(tmp_path / "file" / "pass.json", passed_now(Config(), "", ()))

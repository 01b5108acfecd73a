"""Exit status of `companion fly`, by which systemd starts the recovery."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from companion.app import App
from companion.commands import fly as command
from companion.config.settings import Config
from companion.core.errors import LinkError, OutputError
from companion.pdps.flight.state import FlightState, Phase
from companion.recording.recorder import NOT_RECORDED
from companion.run import unattended
from companion.run.loop import ControlLoop


@contextmanager
def no_rig(*_: object, skip_rehearsal: bool) -> Iterator[tuple[None, Any]]:
    yield None, NOT_RECORDED


@pytest.fixture(autouse=True)
def on_no_drone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "open_rig", no_rig)
    monkeypatch.setattr("companion.run.unattended.signal.signal", lambda *_: None)


def ends(monkeypatch: pytest.MonkeyPatch, phase: Phase) -> None:
    def run(loop: ControlLoop) -> None:
        loop._app.flight = FlightState(phase, trouble="so it ended")

    monkeypatch.setattr(ControlLoop, "run", run)


def flown(folder: Path, console: Console | None = None) -> int:
    config = Config()
    return command._fly(App(config), config, folder, console or Console(quiet=True))


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EIO])
def test_an_error_in_flight_gives_the_failure_status_and_the_map_is_saved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def fail(loop: ControlLoop) -> None:
        raise LinkError(os.strerror(number))

    monkeypatch.setattr(ControlLoop, "run", fail)
    assert flown(tmp_path) == unattended.EXIT_FAILED
    assert (tmp_path / "map.json").exists()


@pytest.mark.parametrize(
    ("phase", "status"), [(Phase.DONE, 3), (Phase.HANDED_OVER, 3), (Phase.FAILED, 1)]
)
@pytest.mark.parametrize("error", [OutputError("disk full"), RuntimeError("no fonts")])
def test_a_map_that_cannot_be_saved_does_not_change_the_exit_status(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    phase: Phase,
    status: int,
    error: Exception,
) -> None:
    def refuse(*_: object) -> None:
        raise error

    ends(monkeypatch, phase)
    monkeypatch.setattr(unattended, "save", refuse)
    console = Console(record=True, quiet=False, width=200, file=open(os.devnull, "w"))  # noqa: SIM115
    assert flown(tmp_path, console) == status
    assert "the map is not saved" in console.export_text()
    console.file.close()

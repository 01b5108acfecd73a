"""A flight whose files could not be written is rejected on the ground."""

import shutil
from collections import namedtuple
from pathlib import Path

import pytest

from companion.config import settings as configuration
from companion.core.background_writer import BackgroundWriter
from companion.core.errors import OutputError
from companion.recording import room
from companion.recording.room import refuse_no_room
from companion.run.hardware import open_rig

TEN_MINUTES = {"mission.time_limit_s": 600}
Usage = namedtuple("Usage", "total used free")


def free(monkeypatch: pytest.MonkeyPatch, megabytes: float) -> None:
    usage = Usage(10**10, 0, int(megabytes * 1e6))
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: usage)


def test_a_writable_folder_is_created_and_left_empty(tmp_path: Path) -> None:
    refuse_no_room(tmp_path / "new" / "out", configuration.load(None, {}))
    assert list((tmp_path / "new" / "out").iterdir()) == []


@pytest.mark.parametrize("name", ["file", "file/out"])
def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=rf"^{tmp_path / name}: .*use another --out$"):
        refuse_no_room(tmp_path / name, configuration.load(None, {}))


def test_a_full_disk_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room.os, "getpid", lambda: 7)  # type: ignore[attr-defined]
    (tmp_path / ".trial-7").symlink_to("/dev/full")
    with pytest.raises(OutputError, match="No space left on device"):
        refuse_no_room(tmp_path, configuration.load(None, {}))
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_hangs_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "ANSWER_S", 0.0)
    monkeypatch.setattr(BackgroundWriter, "wait", lambda self, timeout_s: timeout_s > 0)
    with pytest.raises(OutputError, match="does not answer"):
        refuse_no_room(tmp_path, configuration.load(None, {}))


@pytest.mark.parametrize(("megabytes", "minutes"), [(35, 10), (50, 20), (15, 1)])
def test_a_card_without_room_for_the_flight_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, megabytes: float, minutes: float
) -> None:
    free(monkeypatch, megabytes)
    config = configuration.load(None, {"mission.time_limit_s": minutes * 60})
    with pytest.raises(OutputError, match=f"{megabytes} MB are free, .* {16 + 2 * minutes:g} MB"):
        refuse_no_room(tmp_path, config)


def test_a_flight_without_recording_needs_little_space(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    free(monkeypatch, 17)
    refuse_no_room(tmp_path, configuration.load(None, TEN_MINUTES | {"recording.enabled": False}))


def test_the_folder_is_refused_before_devices_are_opened(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    config = configuration.load(None, {"link.url": "serial:/dev/nowhere:57600"})
    with pytest.raises(OutputError), open_rig(config, tmp_path / "file", print):
        pass

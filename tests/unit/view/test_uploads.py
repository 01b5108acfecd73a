"""Tests that files from the browser stay in their folder, and what is said about bad ones."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from companion.core.errors import RecordingError
from companion.view.access.act_queue import ActQueue
from companion.view.access.server import PageServer, open_page
from companion.view.playback import playable
from companion.view.uploads import Uploads


@pytest.fixture(scope="module")
def server() -> Iterator[PageServer]:
    server, _ = open_page("127.0.0.1", 0, None, "test")
    yield server
    server.stop()


class Client:
    """A browser that gets notifications."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def add_notification(self, title: str, body: str, **_: object) -> None:
        self.told.append(body)


def received(
    server: PageServer, folder: Path, name: str, content: bytes
) -> tuple[list[Path], Client]:
    """The files that were taken after an upload, and its client; only recordings are good."""
    taken: list[Path] = []

    def take(path: Path) -> None:
        taken.append(path)
        if path.suffix == ".mcap":
            playable(path)

    turns, client = ActQueue(server), Client()
    uploads = Uploads(server.gui, turns, folder, "", take)
    uploads._button._impl.value = SimpleNamespace(name=name, content=content)
    uploads._receive(cast(Any, SimpleNamespace(client=client)))
    turns.run(iter([False, True]).__next__)
    return taken, client


@pytest.mark.parametrize("name", ["plan.json", "../../plan.json", "C:\\plans\\plan.json", ""])
def test_a_file_stays_in_its_folder(server: PageServer, tmp_path: Path, name: str) -> None:
    [path], client = received(server, tmp_path, name, b"{}")
    assert path.parent == tmp_path
    assert path.read_bytes() == b"{}"
    assert not client.told


def test_an_error_names_the_file_as_the_user_does(server: PageServer, tmp_path: Path) -> None:
    _, client = received(server, tmp_path, "flight.mcap", b"no recording")
    [told] = client.told
    assert told.startswith("flight.mcap: ")


def test_a_recording_without_a_flight_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"none\.mcap"):
        playable(tmp_path / "none.mcap")

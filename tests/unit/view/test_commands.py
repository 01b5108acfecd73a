"""Tests that view commands report errors in one line, and that other commands do not load viser."""

import subprocess
import sys

import pytest

from tests.waiting import DEADLINE_S

pytestmark = pytest.mark.processes


WITHOUT_VISER = "import sys; sys.modules['viser'] = None; from {}.commands.cli import main; main()"


def run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *command], capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (("sitl", "view", "--host", "0.0.0.0"), "--host 0.0.0.0: others can reach this address"),
        (("sitl", "view", "nowhere", "--port", "0"), "no world 'nowhere'; known: complex"),
        (("sitl", "view", "none.mcap", "--port", "0"), "none.mcap: No such file or directory"),
        (("companion", "view", "127.0.0.1:1", "--port", "0"), "needs view.listen"),
        (("companion", "view", "drone:port"), "should be HOST or HOST:PORT"),
    ],
)
def test_errors_are_reported_in_one_line(command: tuple[str, ...], words: str) -> None:
    refused = run("-m", *command)
    assert refused.returncode == 2, refused.stderr
    assert words in refused.stderr
    assert len(refused.stderr.splitlines()) == 1
    assert "http" not in refused.stdout


@pytest.mark.parametrize("program", ["sitl", "companion"])
def test_a_missing_viewer_extra_is_reported_with_the_remedy(program: str) -> None:
    refused = run("-c", WITHOUT_VISER.format(program), "view", "room_100")
    assert refused.returncode == 2
    assert refused.stderr.strip() == (
        f"{program}: this needs viser, which is not installed: pip install 'pdps-companion[viewer]'"
    )


def test_the_companion_command_does_not_load_viser() -> None:
    loaded = run("-c", "import sys, companion.commands.cli; print('viser' in sys.modules)")
    assert loaded.stdout.strip() == "False"

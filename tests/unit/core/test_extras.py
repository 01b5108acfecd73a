"""Without an extra, commands that do not need it work; the others name it in their error."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from companion.core.errors import MissingExtraError
from companion.core.extras import needs_extra

pytestmark = pytest.mark.processes

BLOCKER = """
import os, sys
gone = os.environ["GONE"].split(",")
class Gone:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in gone:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Gone())
"""
SITL_PACKAGES = "fcl,evo,PIL,yaml"
ALL_PACKAGES = f"{SITL_PACKAGES},ezdxf,shapely,pyoctomap,viser,websockets"
PROJECT = Path(__file__).parents[3]


def run(tmp_path: Path, gone: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a foreign folder, with our modules and without the packages `gone`."""
    (tmp_path / "sitecustomize.py").write_text(BLOCKER)
    paths = os.pathsep.join([str(tmp_path), str(PROJECT)])
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": paths, "GONE": gone, "PYTEST_ADDOPTS": ""},
        capture_output=True,
        text=True,
        check=False,
    )


def run_tests(tmp_path: Path, text: str) -> subprocess.CompletedProcess[str]:
    """Run pytest on a foreign test file, with our plugin only."""
    (tmp_path / "test_other.py").write_text(text)
    given = ("-p", "no:sitl", "-p", "sitl.pytest_plugin", "-p", "no:cacheprovider")
    return run(tmp_path, SITL_PACKAGES, "-m", "pytest", *given, "test_other.py")


def test_tests_that_do_not_fly_run_without_the_simulator(tmp_path: Path) -> None:
    ended = run_tests(tmp_path, "def test_other():\n    assert True\n")
    assert ended.returncode == 0, ended.stdout
    assert "1 passed" in ended.stdout


def test_a_test_that_flies_fails_with_the_remedy(tmp_path: Path) -> None:
    ended = run_tests(tmp_path, "def test_other(sitl):\n    assert True\n")
    assert ended.returncode == 1
    assert "pip install 'pdps-companion[sitl]'" in ended.stdout


@pytest.mark.parametrize("arguments", [["--help"], ["world", "list"], ["fly", "room_100"]])
def test_sitl_names_its_extra_in_one_line(tmp_path: Path, arguments: list[str]) -> None:
    ended = run(tmp_path, SITL_PACKAGES, "-m", "sitl", *arguments)
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert ended.stderr.count("\n") == 1
    assert "pip install 'pdps-companion[sitl]'" in ended.stderr


@pytest.mark.parametrize("command", ["export", "report", "view", "replay", "map", "check", "fly"])
def test_the_help_of_every_command_needs_no_extra(tmp_path: Path, command: str) -> None:
    ended = run(tmp_path, ALL_PACKAGES, "-m", "companion", command, "--help")
    assert ended.returncode == 0, ended.stderr


def test_view_names_its_extra(tmp_path: Path) -> None:
    ended = run(tmp_path, ALL_PACKAGES, "-m", "companion", "view", "drone.local")
    assert ended.returncode == 2
    assert ended.stderr.count("\n") == 1
    assert "pip install 'pdps-companion[viewer]'" in ended.stderr


def test_the_error_names_the_extra_that_contains_the_package() -> None:
    """The simulator's page needs two extras."""
    with (
        pytest.raises(MissingExtraError, match=r"fcl.*pdps-companion\[sitl\]"),
        needs_extra("viewer"),
    ):
        raise ModuleNotFoundError("No module named 'fcl'", name="fcl")

"""Commands behave the same in any terminal or notebook."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.processes

BACKENDS = ["module://matplotlib_inline.backend_inline", "Qt4Agg", "no such thing"]
OWN = """
import companion.export.map_png, pathlib
from companion.core.messages import FloorPlan
companion.export.map_png.draw(FloorPlan(), pathlib.Path("plan.png"))
import matplotlib, os
print(matplotlib.rcParams["backend"], os.environ["MPLBACKEND"])
"""


def run(tmp_path: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[3]), **environment},
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )


@pytest.mark.parametrize("encoding", ["ascii", "cp437", "cp1251", "cp1252", "cp932", "utf-8"])
def test_what_the_stream_cannot_write_does_not_end_a_command(tmp_path: Path, encoding: str) -> None:
    ended = run(tmp_path, "-m", "sitl", "world", "list", PYTHONIOENCODING=encoding)
    assert ended.returncode == 0, ended.stderr
    assert "room_100" in ended.stdout


@pytest.mark.parametrize("module", ["sitl", "companion"])
def test_nor_does_a_refusal(tmp_path: Path, module: str) -> None:
    command = {"sitl": ["world", "check"], "companion": ["map"]}[module]
    ended = run(tmp_path, "-m", module, *command, "Küche × 2.csv", PYTHONIOENCODING="ascii")
    assert ended.returncode == 2
    assert "K?che ? 2.csv" in ended.stderr
    assert "Traceback" not in ended.stderr


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_notebooks_backend_is_not_asked_for(tmp_path: Path, backend: str) -> None:
    show = ("world", "show", "room_100", "--out", "plan.png")
    ended = run(tmp_path, "-m", "sitl", *show, MPLBACKEND=backend)
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "plan.png").stat().st_size > 0


@pytest.mark.parametrize("backend", BACKENDS)
def test_nor_by_a_program_that_uses_our_modules(tmp_path: Path, backend: str) -> None:
    ended = run(tmp_path, "-c", OWN, MPLBACKEND=backend)
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "plan.png").stat().st_size > 0


@pytest.mark.parametrize("first", ["", "import matplotlib\n"])
def test_a_program_keeps_the_backend_that_it_has(tmp_path: Path, first: str) -> None:
    ended = run(tmp_path, "-c", first + OWN, MPLBACKEND="svg")
    assert ended.stdout.split() == ["svg", "svg"], ended.stderr

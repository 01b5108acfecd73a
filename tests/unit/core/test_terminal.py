"""Commands behave the same in any terminal or notebook."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.processes

BACKENDS = ["module://matplotlib_inline.backend_inline", "Qt4Agg", "no such thing"]
PROGRAM = """
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
def test_characters_outside_the_streams_encoding_do_not_end_a_command(
    tmp_path: Path, encoding: str
) -> None:
    ended = run(tmp_path, "-m", "sitl", "world", "list", PYTHONIOENCODING=encoding)
    assert ended.returncode == 0, ended.stderr
    assert "room_100" in ended.stdout


@pytest.mark.parametrize("module", ["sitl", "companion"])
def test_characters_outside_the_streams_encoding_are_replaced_in_an_error(
    tmp_path: Path, module: str
) -> None:
    command = {"sitl": ["world", "check"], "companion": ["map"]}[module]
    ended = run(tmp_path, "-m", module, *command, "Küche × 2.csv", PYTHONIOENCODING="ascii")
    assert ended.returncode == 2
    assert "K?che ? 2.csv" in ended.stderr
    assert "Traceback" not in ended.stderr


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_command_does_not_use_the_matplotlib_backend_of_a_notebook(
    tmp_path: Path, backend: str
) -> None:
    show = ("world", "show", "room_100", "--out", "plan.png")
    ended = run(tmp_path, "-m", "sitl", *show, MPLBACKEND=backend)
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "plan.png").stat().st_size > 0


@pytest.mark.parametrize("backend", BACKENDS)
def test_our_modules_do_not_use_the_matplotlib_backend_of_a_notebook(
    tmp_path: Path, backend: str
) -> None:
    ended = run(tmp_path, "-c", PROGRAM, MPLBACKEND=backend)
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "plan.png").stat().st_size > 0


@pytest.mark.parametrize("first", ["", "import matplotlib\n"])
def test_a_program_keeps_its_own_matplotlib_backend(tmp_path: Path, first: str) -> None:
    ended = run(tmp_path, "-c", first + PROGRAM, MPLBACKEND="svg")
    assert ended.stdout.split() == ["svg", "svg"], ended.stderr


def test_pictures_do_not_depend_on_the_users_matplotlibrc(tmp_path: Path) -> None:
    """Its TeX may be missing here, and a tight box would crop a sheet that is to scale."""
    show = ("-m", "sitl", "world", "show", "room_100", "--out")
    plain = run(tmp_path, *show, "plain.png")
    (tmp_path / "matplotlibrc").write_text(
        "text.usetex: True\nsavefig.bbox: tight\nfont.size: 30\nsavefig.facecolor: black\n"
    )
    styled = run(tmp_path, *show, "styled.png")
    assert (plain.returncode, styled.returncode) == (0, 0), styled.stderr
    assert (tmp_path / "plain.png").read_bytes() == (tmp_path / "styled.png").read_bytes()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
@pytest.mark.parametrize(
    ("module", "command"),
    [
        ("sitl", ["world", "list"]),
        ("sitl", ["world", "check", "room_100"]),
        ("companion", ["config", "reference"]),
    ],
)
def test_output_to_a_full_disk_is_told_in_one_line(module: str, command: list[str]) -> None:
    with open("/dev/full", "w", encoding="utf-8") as full:
        ended = subprocess.run(
            [sys.executable, "-m", module, *command],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert ended.returncode == 2
    assert ended.stderr == (f"{module}: its output cannot be written: No space left on device\n")

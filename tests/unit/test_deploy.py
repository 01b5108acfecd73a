"""What is installed on the drone: scripts, unit and files, as far as they can be held to here."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.deploy import DEPLOY, UNITS, exposure, lint_scripts, verify_units
from companion import config as configuration
from companion.fly_cli import exit_status
from companion.pdps.flight import Flight, Phase
from sitl.autopilot.parameters.table import load_table

LEFT_OUT = (
    *("lxml", "zstandard", "setuptools", "pkg_resources", "pip", "tzdata"),
    *("scipy.io", "scipy.signal", "scipy.odr", "scipy.cluster", "scipy.fftpack"),
    *("PIL._avif", "PIL._imagingcms", "PIL._imagingft", "PIL._imagingtk"),
)
"""By deploy/slim.sh."""
HARDWARE_ONLY = {"BRD_SER2_RTSCTS"}
"""Of real boards; the emulated autopilot has no serial ports."""
STUB = """#!/bin/sh
# Stands for python3: makes a venv of itself, installs nothing
case "$1 $2" in
    "-m venv") mkdir -p "$3/bin" && cp "$0" "$3/bin/python" ;;
    "-m pip" | "-m ensurepip") ;;
    "-c import sysconfig; print"*) echo "@PACKAGES@" ;;
    *) exec @PYTHON@ "$@" ;;
esac
"""
needs_systemd = pytest.mark.skipif(
    shutil.which("systemd-analyze") is None, reason="no systemd-analyze on this machine"
)


def test_the_scripts_pass_shellcheck() -> None:
    assert lint_scripts() == ""


@needs_systemd
def test_systemd_takes_the_units() -> None:
    assert verify_units() == ""


@needs_systemd
def test_the_units_are_hardened() -> None:
    assert exposure() <= 3.0


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize(
    ("phase", "is_failure"),
    [(Phase.DONE, False), (Phase.HANDED_OVER, False), (Phase.FAILED, True)],
)
def test_only_a_flight_that_failed_is_a_failure_to_systemd(
    unit: str, phase: Phase, is_failure: bool
) -> None:
    """What follows a failure lands a drone that is in our mode, also one that was given back."""
    (told,) = re.findall(r"^SuccessExitStatus=(\d+)$", (DEPLOY / unit).read_text(), re.MULTILINE)
    status = exit_status(Flight(phase, trouble="so it ended"))
    assert (status not in (0, int(told))) == is_failure


def test_the_configuration_that_is_installed_can_be_used() -> None:
    sensors = configuration.load(DEPLOY / "drone.toml").sensors
    assert len(sensors.beams) == 5


@pytest.mark.parametrize(
    ("file", "autopilot"), [("ardupilot.parm", "ardupilot"), ("px4.params", "px4")]
)
def test_the_parameters_exist_and_are_in_range(file: str, autopilot: str) -> None:
    table = load_table(autopilot)
    lines = [line.split("#")[0].split() for line in (DEPLOY / file).read_text().splitlines()]
    told = [(w[2], w[3]) if len(w) == 5 else (w[0], w[1]) for w in lines if w]
    assert told
    for name, value in told:
        if name not in HARDWARE_ONLY:
            parameter = table[name]
            assert parameter.least <= float(value) <= parameter.most


def install(root: Path, stub: Path, *arguments: str) -> str:
    command = [str(DEPLOY / "install.sh"), "--root", str(root), "--python", str(stub), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=120).stdout


@pytest.fixture
def stub(tmp_path: Path) -> Path:
    packages = tmp_path / "packages"
    (packages / "pymavlink" / "dialects" / "v20").mkdir(parents=True)
    (packages / "scipy" / "tests").mkdir(parents=True)
    path = tmp_path / "python3"
    path.write_text(STUB.replace("@PACKAGES@", str(packages)).replace("@PYTHON@", sys.executable))
    path.chmod(0o755)
    return path


def files(root: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(root)): path.read_bytes()
        for path in root.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_installing_again_changes_nothing_and_keeps_what_was_configured(
    tmp_path: Path, stub: Path
) -> None:
    root = tmp_path / "root"
    boot = root / "boot" / "firmware"
    boot.mkdir(parents=True)
    (boot / "config.txt").write_text("[all]\ndtparam=spi=on\n")
    (boot / "cmdline.txt").write_text("console=serial0,115200 console=tty1 root=/dev/sda2\n")
    assert "companion check" in install(root, stub)
    (root / "etc/pdps/drone.toml").write_text("# mine\n")
    first = files(root)
    install(root, stub)
    assert files(root) == first
    assert first["etc/pdps/drone.toml"] == b"# mine\n"
    config = first["boot/firmware/config.txt"].decode().splitlines()
    assert config.count("dtparam=spi=on") == 1
    assert "dtoverlay=disable-bt" in config
    assert first["boot/firmware/cmdline.txt"] == b"console=tty1 root=/dev/sda2\n"


def test_a_flight_needs_nothing_of_what_is_left_out() -> None:
    script = f"""
import runpy, sys
for name in {LEFT_OUT}:
    sys.modules[name] = None
runpy.run_path({str(DEPLOY / "self_test.py")!r}, run_name="__main__")
"""
    subprocess.run([sys.executable, "-c", script], check=True, timeout=120)


def test_the_units_point_to_documentation_that_is_installed(tmp_path: Path, stub: Path) -> None:
    root = tmp_path / "root"
    install(root, stub)
    for unit in UNITS:
        text = (root / "etc/systemd/system" / unit).read_text()
        (named,) = re.findall(r"^Documentation=file:/(\S+)$", text, re.MULTILINE)
        assert (root / named).exists()


def test_uninstalling_leaves_configuration_and_maps(tmp_path: Path, stub: Path) -> None:
    root = tmp_path / "root"
    install(root, stub)
    subprocess.run([str(DEPLOY / "uninstall.sh"), "--root", str(root)], check=True, timeout=60)
    assert set(files(root)) == {"etc/pdps/drone.toml"}
    purge = [str(DEPLOY / "uninstall.sh"), "--root", str(root), "--purge"]
    subprocess.run(purge, check=True, timeout=60)
    assert files(root) == {}


def test_an_unknown_option_is_named(tmp_path: Path) -> None:
    ended = subprocess.run(
        [str(DEPLOY / "install.sh"), "--fly"],
        check=False,
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ},
    )
    assert ended.returncode == 2
    assert "--fly" in ended.stderr

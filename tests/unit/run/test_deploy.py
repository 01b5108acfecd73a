"""Files installed on the drone: scripts, units and configuration, tested off the drone."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from benchmarks.devices.deploy import DEPLOY, UNITS, exposure, lint_scripts, verify_units
from companion.config import settings as configuration
from companion.pdps.flight.state import FlightState, Phase
from companion.run.unattended import exit_status
from sitl.autopilot.parameters.table import load_table
from tests.deployed import FILES, deployed

pytestmark = pytest.mark.processes

_spec = importlib.util.spec_from_file_location("boot_config", DEPLOY / "boot_config.py")
assert _spec is not None
assert _spec.loader is not None
boot_config = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(boot_config)
LEFT_OUT = (
    *("lxml", "zstandard", "setuptools", "pkg_resources", "pip", "tzdata"),
    *("scipy.cluster", "scipy.fft", "scipy.fftpack", "scipy.integrate", "scipy.interpolate"),
    *("scipy.io", "scipy.odr", "scipy.optimize", "scipy.signal", "scipy.stats"),
    *("PIL._avif", "PIL._imagingcms", "PIL._imagingft", "PIL._imagingtk"),
)
"""Modules that deploy/slim.sh removes."""
HARDWARE_ONLY = {"BRD_SER2_RTSCTS"}
"""Parameters of real boards; the emulated autopilot has no serial ports."""
STUB = """#!/bin/sh
# Stands for python3: makes a venv of itself, installs nothing
case "$1 $2" in
    "-m venv") mkdir -p "$3/bin" && cp "$0" "$3/bin/python" ;;
    "-m pip") echo "$@" >> "@PACKAGES@/pip.txt" ;;
    "-m ensurepip") ;;
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
def test_systemd_accepts_the_units() -> None:
    assert verify_units() == ""


@needs_systemd
def test_the_units_are_hardened() -> None:
    assert exposure() <= 3.0


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize(
    ("phase", "is_failure"),
    [(Phase.DONE, False), (Phase.HANDED_OVER, False), (Phase.FAILED, True)],
)
def test_only_a_failed_flight_has_a_failure_status_for_systemd(
    unit: str, phase: Phase, is_failure: bool
) -> None:
    """The unit that starts after a failure lands a drone in our mode, also after a change back."""
    (success,) = re.findall(r"^SuccessExitStatus=(\d+)$", (DEPLOY / unit).read_text(), re.MULTILINE)
    status = exit_status(FlightState(phase, trouble="so it ended"))
    assert (status not in (0, int(success))) == is_failure


def test_the_installed_configuration_is_valid() -> None:
    sensors = configuration.load(DEPLOY / "drone.toml").sensors
    assert len(sensors.beams) == 5


@pytest.mark.parametrize("autopilot", FILES)
def test_the_parameters_exist_and_are_in_range(autopilot: str) -> None:
    table, values = load_table(autopilot), deployed(autopilot)
    assert set(values) - set(table) <= HARDWARE_ONLY
    for name, value in values.items():
        if name in table:
            assert table[name].least <= value <= table[name].most


@pytest.mark.parametrize("autopilot", FILES)
def test_every_parameter_has_its_own_comment_on_the_line_above(autopilot: str) -> None:
    """Ground stations differ in what they take at the end of a line."""
    lines = FILES[autopilot].read_text().splitlines()
    for above, line in pairwise(lines):
        if line and not line.startswith("#"):
            assert above.startswith("# "), line
            assert not above.startswith("# ---"), line
            assert "#" not in line


def test_nothing_but_landing_follows_a_failure() -> None:
    """A return first climbs, into the ceiling; an exception would ignore the failure."""
    ardupilot, px4 = deployed("ardupilot"), deployed("px4")
    assert ardupilot["FS_THR_ENABLE"] == px4["NAV_RCL_ACT"] == 3
    assert ardupilot["FS_OPTIONS"] == px4["COM_RCL_EXCEPT"] == 0
    assert ardupilot["BATT_FS_CRT_ACT"] == ardupilot["FS_DR_ENABLE"] == 1
    assert px4["COM_LOW_BAT_ACT"] == 2
    assert ardupilot["RTL_ALT"] <= 30
    assert px4["RTL_RETURN_ALT"] == px4["RTL_DESCEND_ALT"] == 0


@pytest.mark.parametrize("page", ["first-flight.md", "deploy.md"])
def test_the_documentation_gives_the_values_of_the_files(page: str) -> None:
    """In the documentation a value stands as `NAME VALUE`."""
    both = deployed("ardupilot") | deployed("px4")
    text = (DEPLOY.parent / "docs" / page).read_text()
    stated = re.findall(r"`([A-Z][A-Z0-9_]+) (-?[0-9.]+)`", text)
    differing = {n: v for n, v in stated if n in both and float(v) != both[n]}
    assert differing == {}
    assert page == "deploy.md" or len({name for name, _ in stated} & set(both)) > 5


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


def test_installing_again_changes_nothing_and_keeps_the_configuration(
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
    install(root, stub, "--extra", "foxglove,team")
    assert files(root) == first
    installed = (tmp_path / "packages" / "pip.txt").read_text().splitlines()
    assert [line.rpartition(" ")[2] for line in installed] == [
        f"{DEPLOY.parent}{extras}" for extras in ("", "[foxglove,team]")
    ]
    assert first["etc/pdps/drone.toml"] == b"# mine\n"
    config = first["boot/firmware/config.txt"].decode().splitlines()
    assert config.count("dtparam=spi=on") == 1
    assert "dtoverlay=disable-bt" in config
    assert first["boot/firmware/cmdline.txt"] == b"console=tty1 root=/dev/sda2\n"


WANTED_ON = {
    "pi02": {"dtoverlay disable-bt": ""},
    "pi3": {"dtoverlay disable-bt": ""},
    "pi4": {"dtoverlay disable-bt": ""},
    "pi5": {"dtparam uart0": "on"},
}
EVERYWHERE = {
    "dtparam i2c_arm": "on",
    "dtparam i2c_arm_baudrate": "400000",
    "dtparam spi": "on",
    "enable_uart": "1",
}
CONFIGS = {
    "none": "",
    "shipped": (
        "# For more options see http://rptl.io/configtxt\n#dtparam=i2c_arm=on\n#dtparam=spi=on\n"
        "dtparam=audio=on\n\n[cm4]\notg_mode=1\n\n[cm5]\ndtoverlay=dwc2,dr_mode=host\n\n[all]\n"
    ),
    "ends in another model's section": "dtparam=audio=on\n[cm4]\notg_mode=1\n",
    "ends in a filter": "[all]\ndtparam=spi=on\n[pi4]\n[gpio4=1]\nenable_uart=1\n",
    "no end of line": "[all]\ndtparam=spi=on\n[pi5]\narm_boost=1",
    "of Windows": "dtparam=audio=on\r\n[cm4]\r\notg_mode=1\r\n",
    "taken back": "dtparam=i2c_arm=on,spi=on\nenable_uart=1\nenable_uart=0\ndtparam=spi=off\n",
    "in a wrong section": "[pi0]\ndtparam=i2c_arm=on,i2c_arm_baudrate=400000\nenable_uart=1\n",
    "not ASCII": "# für die Drohne\n[pi4]\n",
}


@pytest.mark.parametrize("name", CONFIGS)
def test_every_model_gets_its_buses_with_any_existing_config_txt(name: str) -> None:
    text = CONFIGS[name]
    new = boot_config.with_buses(text)
    assert new.startswith(text)
    for model, wanted in WANTED_ON.items():
        assert EVERYWHERE.items() <= boot_config.in_force(new.splitlines(), model).items()
        assert wanted.items() <= boot_config.in_force(new.splitlines(), model).items()
    assert "dtoverlay disable-bt" not in boot_config.in_force(new.splitlines(), "pi5")
    added = new[len(text) :]
    assert "otg_mode=1dtparam" not in new
    assert ("\r\n" in added) == ("\r\n" in text)
    assert "\n" not in added.replace("\r\n", "") or "\r\n" not in text
    assert boot_config.with_buses(new) == new
    assert boot_config.in_force([*new.splitlines(), "later=1"], "pi1")["later"] == "1"


def test_existing_settings_are_not_written_again() -> None:
    text = (
        "dtparam=spi=on\n[pi4]\ndtoverlay=disable-bt\n[cm5]\nx=1\n[pi5]\ndtparam=uart0\n[all]\n"
        "enable_uart=1\ndtparam=i2c=on\ndtparam=i2c_arm_baudrate=400000\n"
    )
    added = boot_config.with_buses(text)[len(text) :]
    once = "dtoverlay=disable-bt"
    assert added.split() == ["[pi02]", once, "[pi3]", once, "[all]"]


COMMAND_LINES = [
    ("console=serial0,115200 console=tty1 root=/dev/sda2\n", "console=tty1 root=/dev/sda2\n"),
    ("console=tty1 root=/dev/sda2 console=ttyAMA0,115200n8", "console=tty1 root=/dev/sda2"),
    ("a console=serial0 kgdboc=ttyAMA0,115200 b\r\n", "a b\r\n"),
    ("console=ttyS0,9600 console=tty1", "console=tty1"),
    ("console=ttyAMA01 netconsole=serial0,1 c\n", "console=ttyAMA01 netconsole=serial0,1 c\n"),
    ("console=tty1  quiet \n", "console=tty1  quiet \n"),
]


@pytest.mark.parametrize(("line", "without"), COMMAND_LINES)
def test_the_login_shell_is_removed_from_the_port(line: str, without: str) -> None:
    assert boot_config.without_login(line, boot_config.PINS_BEFORE_PI_5) == without


@pytest.mark.parametrize(
    ("model", "line"),
    [
        ("Raspberry Pi 5 Model B Rev 1.0", "console=serial0,115200 console=tty1\n"),
        ("Raspberry Pi Compute Module 5 Rev 1.0", "console=serial0,115200 console=tty1\n"),
        ("Raspberry Pi 500 Rev 1.0", "console=serial0,115200 console=tty1\n"),
        ("Raspberry Pi 4 Model B Rev 1.5", "console=tty1\n"),
        ("Raspberry Pi Zero 2 W Rev 1.0", "console=tty1\n"),
        ("", "console=tty1\n"),
    ],
)
def test_a_raspberry_pi_5_keeps_its_debug_connector(
    tmp_path: Path, stub: Path, model: str, line: str
) -> None:
    root = tmp_path / "root"
    boot, tree = root / "boot" / "firmware", root / "proc" / "device-tree"
    boot.mkdir(parents=True)
    tree.mkdir(parents=True)
    (tree / "model").write_text(f"{model}\0")
    command_line = "console=serial0,115200 console=ttyAMA0,115200 console=tty1\n"
    (boot / "cmdline.txt").write_text(command_line)
    install(root, stub)
    assert (boot / "cmdline.txt").read_text() == line
    assert "[pi5]\ndtparam=uart0=on\n" in (boot / "config.txt").read_text()
    assert {path.name for path in boot.iterdir()} == {"cmdline.txt", "config.txt"}


def test_a_flight_works_without_the_removed_modules() -> None:
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

"""Tests the script API and its examples, on a drone of `sitl run`."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import companion
from companion import connect
from companion.core.errors import ConfigError, SensorError
from tests.processes.started import read_until, running_sitl, started
from tests.waiting import DEADLINE_S

EXAMPLES = Path(__file__).parents[2] / "examples" / "scripts"
# Restores Ctrl-C: a shell that runs the tests in the background ignores the signal.
SCRIPT = """
import signal, sys
from threading import Event
from companion import connect
signal.signal(signal.SIGINT, signal.default_int_handler)
drone = connect(link=sys.argv[1], bus=sys.argv[2])
try:
    with drone:
        drone.take_off()
        print("hovering", flush=True)
        {then}
finally:
    print(drone.activity, flush=True)
"""


@pytest.fixture
def drone() -> Iterator[tuple[str, str]]:
    """Addresses of the drone's link and bus."""
    with running_sitl("--speed", "10") as (_, mavlink_port, bus_port):
        yield f"udpout:127.0.0.1:{mavlink_port}", f"sitl://127.0.0.1:{bus_port}"


def run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *command], capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )


def test_the_scan_example_scans_a_room_and_writes_its_map(
    drone: tuple[str, str], tmp_path: Path
) -> None:
    link, bus = drone
    options = ("--link", link, "--bus", bus, "--out", str(tmp_path))
    done = run(str(EXAMPLES / "scan_a_room.py"), *options)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("4 walls, ")
    assert {"room.dxf", "room.png", "map.json"} <= {path.name for path in tmp_path.iterdir()}
    assert list(tmp_path.glob("*.mcap"))


def test_the_look_around_example_prints_ranges_and_lands(drone: tuple[str, str]) -> None:
    link, bus = drone
    done = run(str(EXAMPLES / "look_around.py"), "--link", link, "--bus", bus, "--times", "2")
    assert done.returncode == 0, done.stderr
    assert "front: " in done.stdout
    assert done.stdout.strip().endswith("landed: landing was requested")


def test_an_exception_lands_the_drone(drone: tuple[str, str]) -> None:
    done = run("-c", SCRIPT.format(then="1 / 0"), *drone)
    assert "ZeroDivisionError" in done.stderr
    assert done.stdout.splitlines()[-1] == "landed: landing was requested"


def test_ctrl_c_lands_the_drone(drone: tuple[str, str]) -> None:
    command = [sys.executable, "-c", SCRIPT.format(then="while True: Event().wait(0.1)"), *drone]
    with started(command) as process:
        read_until(process, "hovering")
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=DEADLINE_S)
    assert "landed: landing was requested" in output


def test_invalid_settings_and_a_missing_bus_raise_errors(drone: tuple[str, str]) -> None:
    with pytest.raises(ConfigError, match=r"mission\.height_m = 99"):
        connect(settings={"mission.height_m": 99})
    with pytest.raises(SensorError), connect(bus="sitl://127.0.0.1:1"):
        pass


def test_importing_companion_does_not_import_numpy() -> None:
    done = run("-c", "import companion, sys; print('numpy' in sys.modules)")
    assert done.stdout.strip() == "False"
    assert all(hasattr(companion, name) for name in companion.__all__)

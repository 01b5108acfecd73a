"""Tests the script API and its examples, on a drone of `sitl run`."""

import asyncio
import re
import runpy
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import companion
from companion import AsyncDrone, NotCompletedError, connect, connect_async
from companion.core.errors import ConfigError, SensorError
from tests.processes.started import read_until, running_sitl, started
from tests.waiting import DEADLINE_S
from tests.worlds import SMALL_ROOM

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
    with running_sitl("--speed", "1000", world=SMALL_ROOM) as (_, mavlink_port, bus_port):
        yield f"udpout:127.0.0.1:{mavlink_port}", f"sitl://127.0.0.1:{bus_port}"


def run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *command], capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )


@pytest.fixture
def output_of(
    drone: tuple[str, str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., list[str]]:
    """Runs an example in this process, which has loaded the libraries; returns its lines."""

    def lines(name: str, *options: str) -> list[str]:
        link, bus = drone
        path = str(EXAMPLES / name)
        monkeypatch.setattr(sys, "argv", [path, "--link", link, "--bus", bus, *options])
        runpy.run_path(path, run_name="__main__")
        return capsys.readouterr().out.splitlines()

    return lines


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


def test_the_look_around_example_prints_ranges_and_lands(
    output_of: Callable[..., list[str]],
) -> None:
    first, *_, last = output_of("look_around.py", "--times", "2")
    assert first.startswith("front: ")
    assert last == "landed: landing was requested"


def test_the_square_example_reaches_its_corners_and_lands(
    output_of: Callable[..., list[str]],
) -> None:
    corner, *_, last, end = output_of("fly_a_square.py", "--side", "1")
    assert re.match(r"corner 1: (0\.[89]|1\.[012]) m north, -?0\.[012] m east", corner)
    assert re.match(r"corner 4: -?0\.[012] m north, -?0\.[012] m east", last)
    assert end == "mission complete"


def test_the_asyncio_example_prints_its_telemetry_until_it_has_landed(
    output_of: Callable[..., list[str]],
) -> None:
    lines = output_of("fly_async.py")
    activities = [line for line in lines if " walls, " not in line]
    assert {"flying to a place", "flying at a velocity by order"} <= set(activities)
    assert activities[-2:] == ["landing", "mission complete"]
    assert any(re.match("[1-9] walls, ", line) for line in lines)


def test_a_step_whose_task_is_cancelled_stops_and_an_exception_lands_the_drone(
    drone: tuple[str, str],
) -> None:
    link, bus = drone
    flown = connect_async(link=link, bus=bus)

    async def fly() -> None:
        async with asyncio.timeout(DEADLINE_S), flown:
            with pytest.raises(NotCompletedError, match="on the ground: take_off"):
                await flown.go_home()
            await flown.take_off()
            await cancelled(flown)
            with pytest.raises(NotCompletedError, match="no sensor has measured the space"):
                await flown.fly_to(40.0, 0.0)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        asyncio.run(fly())
    assert flown.activity == "landed: landing was requested"


async def cancelled(flown: AsyncDrone) -> None:
    """Cancel a step in flight, and leave another: the drone hovers, and does not go on."""
    flight = asyncio.create_task(flown.fly_velocity(forward_m_s=0.3, seconds=60.0))
    activities = flown.telemetry.activity()
    while await anext(activities) != "flying at a velocity by order":
        continue
    flight.cancel()
    while await anext(activities) != "waiting for orders":
        continue
    assert flight.cancelled()
    while flown.activity != "flying at a velocity by order":
        await flown.fly_velocity(forward_m_s=0.2)
    while await anext(activities) != "waiting for orders":  # it was not asked again
        continue
    poses = flown.telemetry.pose()
    stopping = [(await anext(poses)).north_m for _ in range(80)]
    assert abs(stopping[-1] - stopping[-40]) < 0.1


def test_an_exception_lands_the_drone(drone: tuple[str, str]) -> None:
    link, bus = drone
    flown = connect(link=link, bus=bus)

    def fly() -> None:
        with flown:
            flown.take_off()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fly()
    assert flown.activity == "landed: landing was requested"


def test_ctrl_c_lands_the_drone(drone: tuple[str, str]) -> None:
    command = [sys.executable, "-c", SCRIPT.format(then="while True: Event().wait(0.1)"), *drone]
    with started(command) as process:
        read_until(process, "hovering")
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=DEADLINE_S)
    assert "landed: landing was requested" in output


def test_invalid_settings_and_a_missing_bus_raise_errors() -> None:
    with pytest.raises(ConfigError, match=r"mission\.height_m = 99"):
        connect(settings={"mission.height_m": 99})
    with pytest.raises(SensorError), connect(bus="sitl://127.0.0.1:1"):
        pass


def test_importing_companion_does_not_import_numpy() -> None:
    done = run("-c", "import companion, sys; print('numpy' in sys.modules)")
    assert done.stdout.strip() == "False"
    assert all(hasattr(companion, name) for name in companion.__all__)

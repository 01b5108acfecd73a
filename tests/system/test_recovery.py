"""SIGKILL in flight, and `companion recover` as systemd starts it."""

import json
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.clocks import SystemClock
from companion.config import LinkConfig
from companion.link.link import Link
from companion.link.reports import Reports
from companion.link.transport import pipe_pair
from companion.recording.reader import read
from companion.recover_cli import listen
from tests.system.processes import companion, free_udp_port, read_until, sitl, started, stop

DEADLINE_S = 120
ROOM = """
name = "small room"
height_m = 2.6
walls = [{ points = [[0, 0], [5, 0], [5, 5.5], [0, 5.5]], closed = true }]
starts = [{ name = "middle", position = [2.5, 2.6] }]
"""


@dataclass
class Killed:
    """A companion was killed while it scanned; the vehicle is still in the air."""

    out: Path
    vehicle: subprocess.Popen[str]
    arguments: list[str]

    def recover(self) -> str:
        """What it says, once it has ended well."""
        done = subprocess.run(
            companion("recover", *self.arguments),
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    @property
    def walls(self) -> list[object]:
        walls: list[object] = json.loads((self.out / "map.json").read_text())["walls"]
        return walls

    def truth(self) -> dict[str, Any]:
        stop(self.vehicle)
        truth: dict[str, Any] = json.loads((self.out / "truth.json").read_text())
        return truth


@contextmanager
def killed_in_flight(out: Path, after_crash: str) -> Iterator[Killed]:
    """In lockstep: the vehicle's time stands still while nobody flies it."""
    config, world, port = out / "drone.toml", out / "room.toml", free_udp_port()
    world.write_text(ROOM)
    config.write_text(f'[mission]\nafter_crash = "{after_crash}"\n')
    serve = ("--mavlink", f"udpout:127.0.0.1:{port}", "--bus-port", "0", "--lockstep")
    truth = ("--truth", str(out / "truth.json"))
    with started(sitl("run", str(world), *serve, "--speed", "1000", *truth)) as vehicle:
        bus = read_until(vehicle, "sitl://").split()[-1]
        link = ("--link", f"udpin:127.0.0.1:{port}", "--bus", bus)
        arguments = ["--config", str(config), *link, "--out", str(out)]
        with started(companion("fly", *arguments)) as pilot:
            read_until(pilot, "scanning parallel to the wall")
            pilot.kill()
            pilot.wait(DEADLINE_S)
        yield Killed(out, vehicle, arguments)


def test_after_a_crash_it_lands_and_leaves_the_map(tmp_path: Path) -> None:
    with killed_in_flight(tmp_path, "land") as killed:
        output = killed.recover()
        truth = killed.truth()
    assert "landed: the companion had crashed" in output
    assert killed.walls
    assert truth["collisions"] == 0
    assert truth["path"][-1]["position_ned_m"][2] == pytest.approx(0.0, abs=0.05)


def test_after_a_crash_it_goes_on_with_the_map(tmp_path: Path) -> None:
    with killed_in_flight(tmp_path, "resume") as killed:
        output = killed.recover()
        truth = killed.truth()
    assert "mission complete" in output
    assert len(killed.walls) == 4
    assert truth["collisions"] == 0
    first, second = sorted(tmp_path.glob("*.mcap"))
    whole = read(second)
    assert len(whole.ticks) > len(read(first).ticks)
    assert whole.ticks[0].now_s < 1.0


def test_it_is_heard_before_anything_else_happens() -> None:
    autopilot, companions = pipe_pair()
    told = "back after a crash at north 1.0 east 2.0 up 1.2 m"
    reports = Reports(LinkConfig(), {})
    autopilot.send(mavlink.MAVLink_heartbeat_message(2, 3, 217, 4, 4, 3))
    vehicle = listen(Link(companions, LinkConfig()), reports, SystemClock(), told)
    assert (vehicle.armed, vehicle.mode) == (True, "GUIDED")
    heard = autopilot.receive()
    assert heard[0].get_type() == "HEARTBEAT"
    assert "".join(m.text for m in heard if m.get_type() == "STATUSTEXT") == f"PDPS: {told}"


def test_with_nobody_in_the_air_there_is_nothing_to_recover(tmp_path: Path) -> None:
    port = free_udp_port()
    serve = ("--mavlink", f"udpout:127.0.0.1:{port}", "--bus-port", "0", "--lockstep")
    with started(sitl("run", "room_100", *serve)) as vehicle:
        bus = read_until(vehicle, "sitl://").split()[-1]
        link = ["--link", f"udpin:127.0.0.1:{port}", "--bus", bus, "--out", str(tmp_path)]
        output = Killed(tmp_path, vehicle, link).recover()
    assert "not armed" in output
    assert "nothing to recover" in output

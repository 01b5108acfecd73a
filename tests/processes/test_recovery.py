"""Tests a companion that dies in flight, and `companion recover` as systemd starts it."""

import json
import resource
import signal
import socket
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.commands.recover import listen
from companion.config.settings import LinkConfig
from companion.link.link import Link
from companion.link.reports import Reports
from companion.link.transports.transport import pipe_pair
from companion.recording.reader import read
from companion.run.clocks import SystemClock
from companion.run.unattended import EXIT_ENDED
from tests.processes.started import (
    companion,
    free_udp_port,
    read_until,
    sitl,
    started,
    stop,
)
from tests.waiting import DEADLINE_S
from tests.worlds import SMALL_ROOM

WATCHDOG_S = 2.0

Pilot = subprocess.Popen[str]
End = Callable[[Pilot], None]


def is_killed(pilot: Pilot) -> None:
    pilot.kill()


def runs_out_of_memory(pilot: Pilot) -> None:
    """Make all further memory allocations of the process fail."""
    resource.prlimit(pilot.pid, resource.RLIMIT_AS, (1, 1))


@dataclass
class Systemd:
    """Imitates systemd's watchdog: receives notifications, and aborts a silent service."""

    listening: socket.socket

    def environment(self) -> list[str]:
        """The environment in which a service is started."""
        address = f"NOTIFY_SOCKET={self.listening.getsockname()}"
        return ["env", address, f"WATCHDOG_USEC={WATCHDOG_S * 1e6:.0f}"]

    def receive(self, words: str) -> None:
        """Wait for a notification."""
        while words not in self.listening.recv(4096).decode():
            pass

    def hangs(self, pilot: Pilot) -> None:
        """Stop the process until the watchdog time has passed."""
        self.receive("WATCHDOG=1")
        pilot.send_signal(signal.SIGSTOP)
        self.listening.settimeout(WATCHDOG_S)
        with pytest.raises(TimeoutError):
            self.receive("nothing more")
        pilot.send_signal(signal.SIGABRT)
        pilot.send_signal(signal.SIGCONT)


@pytest.fixture
def systemd(tmp_path: Path) -> Iterator[Systemd]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.settimeout(DEADLINE_S)
        yield Systemd(listening)


@dataclass
class Killed:
    """A companion killed during its scan; the vehicle is still in the air."""

    out: Path
    vehicle: subprocess.Popen[str]
    arguments: list[str]

    def recover(self, *environment: str) -> str:
        """Recover; return the output after a successful end."""
        done = subprocess.run(
            [*environment, *companion("recover", *self.arguments)],
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
def killed_in_flight(
    out: Path,
    after_crash: str,
    ends: End = is_killed,
    environment: Sequence[str] = (),
    key: Path | None = None,
) -> Iterator[Killed]:
    """Runs in lockstep: the vehicle's time does not advance without a companion."""
    config, port = out / "drone.toml", free_udp_port()
    signed = f'[link]\nsigning_key = "{key}"\n' if key else ""
    config.write_text(f'{signed}[mission]\nafter_crash = "{after_crash}"\n')
    keyed = ("--signing-key", str(key)) if key else ()
    doors = ("--mavlink", f"udpout:127.0.0.1:{port}", "--bus-port", "0")
    serve = (*keyed, *doors, "--lockstep")
    truth = ("--truth", str(out / "truth.json"))
    with started(sitl("run", SMALL_ROOM, *serve, "--speed", "1000", *truth)) as vehicle:
        bus = read_until(vehicle, "sitl://").split()[-1]
        link = ("--link", f"udpin:127.0.0.1:{port}", "--bus", bus)
        arguments = ["--config", str(config), *link, "--out", str(out)]
        with started([*environment, *companion("fly", *arguments)]) as pilot:
            read_until(pilot, "scanning parallel to the wall")
            ends(pilot)
            pilot.communicate(timeout=DEADLINE_S)
            assert pilot.returncode not in (0, EXIT_ENDED)  # otherwise systemd does not restart it
        yield Killed(out, vehicle, arguments)


def assert_landed_with_its_map(killed: Killed, output: str) -> None:
    truth = killed.truth()
    assert "landed: the companion had crashed" in output
    assert killed.walls
    assert truth["collisions"] == 0
    assert truth["path"][-1]["position_ned_m"][2] == pytest.approx(0.0, abs=0.05)


def test_recovery_lands_the_drone_and_keeps_the_map(tmp_path: Path) -> None:
    with killed_in_flight(tmp_path, "land") as killed:
        assert_landed_with_its_map(killed, killed.recover())


def test_recovery_lands_the_drone_with_an_unwritable_disk(tmp_path: Path) -> None:
    """The time stamp of signing, the recording and the map cannot be written."""
    key, out = tmp_path / "signing.key", tmp_path / "out"
    key.write_text("5a" * 32)
    key.chmod(0o600)
    key.with_suffix(".timestamp.new").symlink_to("/dev/full")
    out.mkdir()
    for name in ("map.json", "map.png", "map.ply"):
        (out / f".unfinished-{name}").symlink_to("/dev/full")
    with killed_in_flight(out, "resume", key=key) as killed:
        for recording in out.glob("flight_*.mcap"):
            recording.chmod(0)
        landed = subprocess.run(
            companion("recover", *killed.arguments),
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
            check=False,
        )
        assert landed.returncode in (0, EXIT_ENDED), landed.stdout + landed.stderr
        assert landed.stdout.count("signing_timestamp") == 1
        truth = killed.truth()
    assert truth["path"][-1]["position_ned_m"][2] == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize(
    ("config", "status"),
    [
        ('[link]\nsigning_key = "/nowhere/signing.key"\n', 1),
        ('[link]\nurl = "serial:/dev/nowhere:57600"\n', 1),
        ('[link]\nurl = "nowhere"\n', 2),
    ],
)
def test_only_a_permanent_configuration_error_ends_with_status_2(
    tmp_path: Path, config: str, status: int
) -> None:
    """Systemd restarts the service after any other failure."""
    (tmp_path / "drone.toml").write_text(config)
    arguments = ("--config", str(tmp_path / "drone.toml"), "--out", str(tmp_path))
    ended = subprocess.run(
        companion("recover", *arguments),
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    assert ended.returncode == status, ended.stdout + ended.stderr
    assert "nowhere" in ended.stdout + ended.stderr


def test_a_companion_out_of_memory_exits_and_recovery_lands_the_drone(tmp_path: Path) -> None:
    """The error message needs memory, too."""
    with killed_in_flight(tmp_path, "land", runs_out_of_memory) as killed:
        assert_landed_with_its_map(killed, killed.recover())


def test_the_watchdog_ends_a_hanging_companion_and_recovery_lands_the_drone(
    tmp_path: Path, systemd: Systemd
) -> None:
    environment = systemd.environment()
    with killed_in_flight(tmp_path, "land", systemd.hangs, environment) as killed:
        assert_landed_with_its_map(killed, killed.recover())


def test_recovery_resumes_the_mission_with_the_map(tmp_path: Path) -> None:
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


def test_recovery_first_sends_a_heartbeat_and_a_text() -> None:
    autopilot, companions = pipe_pair()
    text = "back after a crash at north 1.0 east 2.0 up 1.2 m"
    reports = Reports(LinkConfig(), {})
    autopilot.send(mavlink.MAVLink_heartbeat_message(2, 3, 217, 4, 4, 3))
    vehicle = listen(Link(companions, LinkConfig()), reports, SystemClock(), text)
    assert (vehicle.armed, vehicle.mode) == (True, "GUIDED")
    received = autopilot.receive()
    assert received[0].get_type() == "HEARTBEAT"
    assert "".join(m.text for m in received if m.get_type() == "STATUSTEXT") == f"PDPS: {text}"


def test_recovery_does_nothing_for_a_disarmed_vehicle(tmp_path: Path, systemd: Systemd) -> None:
    port = free_udp_port()
    serve = ("--mavlink", f"udpout:127.0.0.1:{port}", "--bus-port", "0", "--lockstep")
    with started(sitl("run", "room_100", *serve)) as vehicle:
        bus = read_until(vehicle, "sitl://").split()[-1]
        link = ["--link", f"udpin:127.0.0.1:{port}", "--bus", bus, "--out", str(tmp_path)]
        output = Killed(tmp_path, vehicle, link).recover(*systemd.environment())
    assert "not armed" in output
    assert "nothing to recover" in output
    systemd.receive("READY=1")  # otherwise systemd counts a failed start and restarts forever

"""Starts processes of simulator and companion, and waits with deadlines, for system tests."""

import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from random import SystemRandom

from companion.config import settings as configuration
from companion.config.settings import Config
from tests.waiting import DEADLINE_S

FIRST_PORT = 20_000
"""First port that a test may choose itself; services of a machine mostly have lower ones."""


def sitl(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "sitl", *arguments]


def companion(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "companion", *arguments]


def free_udp_port() -> int:
    return _free_port(socket.SOCK_DGRAM)


def free_tcp_port() -> int:
    return _free_port(socket.SOCK_STREAM)


def _free_port(kind: socket.SocketKind) -> int:
    """A free port of this host that the system does not hand out for port 0.

    A program that is started with the number may bind it seconds later. Until then no socket with
    a port of the system's choice can take it.
    """
    for port in SystemRandom().sample(_ports_to_choose(), 100):
        with socket.socket(socket.AF_INET, kind) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port
    raise OSError("no free port")


def _ports_to_choose() -> list[int]:
    """Ports outside the interval from which Linux hands out ports itself (ip(7))."""
    limits = Path("/proc/sys/net/ipv4/ip_local_port_range").read_text()
    first, last = map(int, limits.split())
    ports = range(FIRST_PORT, 1 << 16)
    return [port for port in ports if not first <= port <= last] or list(ports)


@contextmanager
def started(command: list[str]) -> Iterator[subprocess.Popen[str]]:
    """Start a process with readable output; kill it at the end if it still runs."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate(timeout=DEADLINE_S)


@contextmanager
def running_sitl(
    *arguments: str, world: str = "room_100"
) -> Iterator[tuple[subprocess.Popen[str], str, str]]:
    """`sitl run` on free ports: its process, MAVLink port and bus port."""
    ports = ("--mavlink", "udpin:127.0.0.1:0", "--bus-port", "0")
    with started(sitl("run", world, *ports, *arguments)) as process:
        mavlink_port, bus_port = re.findall(r"127\.0\.0\.1:(\d+)", read_until(process, "sitl://"))
        yield process, mavlink_port, bus_port


@contextmanager
def vehicle_at(port: int, firmware: str) -> Iterator[None]:
    """`sitl run`, ready, that sends to a client's port."""
    options = ("--autopilot", firmware, "--mavlink", f"udpout:127.0.0.1:{port}", "--bus-port", "0")
    with started(sitl("run", "room_100", *options)) as process:
        read_until(process, "sitl://")
        yield


def stop(process: subprocess.Popen[str]) -> str:
    """Interrupt as Ctrl-C does; return the remaining output."""
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=DEADLINE_S)
    return output


def flying(mavlink_port: str, bus_port: str, out: Path, *options: str) -> subprocess.Popen[str]:
    """`companion fly` with a vehicle of `running_sitl`."""
    return subprocess.Popen(
        companion(
            *("fly", "--link", f"udpout:127.0.0.1:{mavlink_port}"),
            *("--bus", f"sitl://127.0.0.1:{bus_port}", "--out", str(out), *options),
        ),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def pilot(
    number: int,
    mavlink_port: str,
    bus_port: str,
    folder: Path,
    **groups: Mapping[str, object],
) -> list[str]:
    """`companion fly` for the vehicle of that system id, set by a configuration file.

    `groups`: more groups of the file.
    """
    settings = Config.model_validate(
        {
            "link": {"url": f"udpout:127.0.0.1:{mavlink_port}", "system_id": number},
            "sensors": {"bus": f"sitl://127.0.0.1:{bus_port}"},
            **groups,
        }
    )
    file = folder / f"drone_{number}.toml"
    file.write_text(configuration.to_toml(settings))
    return companion("fly", "--config", str(file), "--out", str(folder / f"out_{number}"))


def read_until(process: subprocess.Popen[str], words: str) -> str:
    assert process.stdout is not None
    text = ""
    while words not in text:
        line = process.stdout.readline()
        assert line, f"it ended without saying {words!r}: {text}"
        text += line
    return text

"""Starts processes of simulator and companion, and waits with deadlines, for system tests."""

import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from companion.config import settings as configuration
from companion.config.settings import Config
from tests.waiting import DEADLINE_S


def sitl(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "sitl", *arguments]


def companion(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "companion", *arguments]


def free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def free_tcp_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


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

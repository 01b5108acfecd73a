"""Messages of a flight to systemd."""

import errno
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from companion.run.systemd import Service


@pytest.fixture
def systemd(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.setblocking(False)
        yield listening


def received(systemd: socket.socket) -> list[str]:
    lines: list[str] = []
    while True:
        try:
            lines += systemd.recv(4096).decode().splitlines()
        except BlockingIOError:
            return lines


def test_the_service_is_ready_with_the_first_tick_and_reports_each_phase_once(
    systemd: socket.socket,
) -> None:
    service = Service({"NOTIFY_SOCKET": systemd.getsockname()})
    for activity in ("waiting", "waiting", "taking off", "taking off"):
        service.alive(activity)
    assert received(systemd) == ["READY=1", "STATUS=waiting", "STATUS=taking off"]


def test_the_watchdog_is_fed_several_times_within_its_timeout(systemd: socket.socket) -> None:
    now_s = [0.0]
    environment = {"NOTIFY_SOCKET": systemd.getsockname(), "WATCHDOG_USEC": "2000000"}
    service = Service(environment, lambda: now_s[0])
    fed = 0
    for _ in range(200):
        now_s[0] += 0.05
        service.alive("scanning")
        fed += received(systemd).count("WATCHDOG=1")
    assert 18 <= fed <= 22


def test_a_systemd_that_does_not_read_does_not_block_the_loop(
    systemd: socket.socket,
) -> None:
    service = Service({"NOTIFY_SOCKET": systemd.getsockname()})
    for number in range(2000):
        service.alive(f"phase {number}")
    assert received(systemd)[0] == "READY=1"


def test_the_watchdog_timeout_is_extended_for_the_last_smoothing(systemd: socket.socket) -> None:
    Service({"NOTIFY_SOCKET": systemd.getsockname()}).landed()
    assert "WATCHDOG_USEC=120000000" in received(systemd)


@pytest.mark.parametrize("abstract", [True, False])
def test_a_socket_in_the_abstract_namespace_is_told_from_a_path_with_an_at_sign(
    tmp_path: Path, *, abstract: bool
) -> None:
    name = f"@pdps-{os.getpid()}" if abstract else str(tmp_path / "notify@1")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(f"\0{name[1:]}" if abstract else name)
        systemd.setblocking(False)
        Service({"NOTIFY_SOCKET": name}).alive("scanning")
        assert received(systemd) == ["READY=1", "STATUS=scanning"]


def test_a_missing_or_dead_systemd_does_not_end_the_flight(tmp_path: Path) -> None:
    for environment in ({}, {"NOTIFY_SOCKET": str(tmp_path / "nobody")}):
        Service(environment).alive("scanning")


def test_exhausted_file_descriptors_do_not_end_the_flight(
    systemd: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    service = Service({"NOTIFY_SOCKET": systemd.getsockname()})
    monkeypatch.setattr("companion.run.systemd.socket.socket", refuse)
    service.alive("scanning")

"""Tests that datagrams from strangers do not disturb a flight."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random

import pytest

from sitl.testing.fuzz import bus_request, foreign_frame
from tests.processes.scoring import assert_good
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

MIN_FRAMES, MIN_CONNECTIONS = 2000, 100


class Strangers:
    """Threads that send about a thousand datagrams a second until stopped."""

    def __init__(self, udp_port: int, bus_port: int) -> None:
        self.frames = self.connections = 0
        self._done = threading.Event()
        self._threads = [
            threading.Thread(target=self._send_frames, args=(udp_port,)),
            threading.Thread(target=self._connect, args=(bus_port,)),
        ]

    @contextmanager
    def at_work(self) -> Iterator[None]:
        for thread in self._threads:
            thread.start()
        try:
            yield
        finally:
            self._done.set()
            for thread in self._threads:
                thread.join(5)

    def _send_frames(self, port: int) -> None:
        random = Random(1)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            while not self._done.wait(0.01):
                for _ in range(10):
                    stranger.sendto(foreign_frame(random), ("127.0.0.1", port))
                    self.frames += 1

    def _connect(self, port: int) -> None:
        random = Random(2)
        while not self._done.wait(0.02):
            with suppress(OSError), socket.create_connection(("127.0.0.1", port), 5) as stranger:
                stranger.sendall(random.choice((bus_request(random)[:2], random.randbytes(200))))
            self.connections += 1


@pytest.mark.parametrize("waits", ["vehicle", "companion"])
def test_foreign_datagrams_do_not_disturb_a_flight(waits: str, tmp_path: Path) -> None:
    """Strangers send to the side that waits; the port of the other side is unknown to them."""
    truth, port = tmp_path / "truth.json", free_udp_port()
    kinds = {side: "udpin" if side == waits else "udpout" for side in ("vehicle", "companion")}
    link = ("--mavlink", f"{kinds['vehicle']}:127.0.0.1:{port}", "--bus-port", "0")
    run = sitl("run", SMALL_ROOM, *link, "--lockstep", "--speed", "1000", "--truth", str(truth))
    with started(run) as vehicle:
        bus = read_until(vehicle, "sitl://").split()[-1]
        fly = companion("fly", "--link", f"{kinds['companion']}:127.0.0.1:{port}", "--bus", bus)
        with started([*fly, "--out", str(tmp_path)]) as pilot:
            read_until(pilot, "turning")
            strangers = Strangers(port, int(bus.rpartition(":")[2]))
            with strangers.at_work():
                output, _ = pilot.communicate(timeout=DEADLINE_S)
        assert pilot.returncode == 0, output
        stop(vehicle)
    assert strangers.frames > MIN_FRAMES
    assert strangers.connections > MIN_CONNECTIONS
    assert_good(tmp_path / "map.json", truth, SMALL_ROOM)

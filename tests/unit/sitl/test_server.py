"""Tests how the time of several served vehicles advances in lockstep with their companions."""

import threading
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from companion.drivers.wires.served_bus import VirtualClock
from sitl.running import server
from sitl.running.server import Endpoint, Server, listen
from sitl.sensors.i2c import DeviceBus
from tests.waiting import DEADLINE_S

PATIENCE_S, NOTICED_S = 0.02, 0.2
"""Wall time for which a companion is waited for without lockstep, and longer, s."""


class World:
    """A served object that is only a time."""

    time_s = 0.0

    def advance(self, time_s: float) -> None:
        self.time_s = time_s


class Companions:
    """The clocks of two companions, and the threads in which they wait."""

    def __init__(self, ports: list[int], pool: ThreadPoolExecutor) -> None:
        self._ports, self._pool = ports, pool
        self._clocks: dict[int, VirtualClock] = {}

    def connect(self, number: int) -> None:
        self._clocks[number] = VirtualClock("127.0.0.1", self._ports[number])

    def leave(self, number: int) -> None:
        self._clocks[number].close()

    def close(self) -> None:
        for clock in self._clocks.values():
            clock.close()

    def wait_until(self, number: int, time_s: float) -> Future[tuple[float, int]]:
        return self._pool.submit(self._clocks[number].advance_to, time_s, 0, 0)


@pytest.fixture
def companions(monkeypatch: pytest.MonkeyPatch) -> Iterator[Companions]:
    monkeypatch.setattr(server, "UNATTENDED_AFTER_S", PATIENCE_S)
    endpoints = [Endpoint(DeviceBus({}), listen(0), ()) for _ in range(2)]
    serving = Server(World(), endpoints, speed=1000.0, lockstep=True)
    ports = [endpoint.bus_port for endpoint in endpoints]
    thread = threading.Thread(target=serving.serve)
    thread.start()
    with ThreadPoolExecutor() as pool:
        both = Companions(ports, pool)
        both.connect(0)
        yield both
        both.close()
        serving.stop()
        thread.join(DEADLINE_S)


def time_of(waiting: Future[tuple[float, int]]) -> float:
    return waiting.result(DEADLINE_S)[0]


def stands_still(waiting: Future[tuple[float, int]]) -> bool:
    try:
        waiting.result(NOTICED_S)
    except TimeoutError:
        return True
    return False


def test_time_waits_for_a_companion_that_computes_for_long(companions: Companions) -> None:
    companions.connect(1)
    waiting = [companions.wait_until(number, 0.05) for number in (0, 1)]
    assert [time_of(each) for each in waiting] == [0.05, 0.05]
    first = companions.wait_until(0, 0.1)
    assert stands_still(first)
    second = companions.wait_until(1, 0.15)
    assert time_of(first) == 0.1
    assert stands_still(second)
    third = companions.wait_until(0, 0.15)
    assert (time_of(second), time_of(third)) == (0.15, 0.15)


def test_a_companion_that_has_left_is_not_waited_for(companions: Companions) -> None:
    companions.connect(1)
    both = [companions.wait_until(number, 0.05) for number in (0, 1)]
    assert [time_of(each) for each in both] == [0.05, 0.05]
    first = companions.wait_until(0, 0.1)
    assert stands_still(first)
    companions.leave(1)
    assert time_of(first) == 0.1


def test_time_begins_when_every_vehicle_has_its_companion(companions: Companions) -> None:
    first = companions.wait_until(0, 0.05)
    assert stands_still(first)
    companions.connect(1)
    assert stands_still(first)
    second = companions.wait_until(1, 0.05)
    assert (time_of(first), time_of(second)) == (0.05, 0.05)


def test_a_companion_that_left_before_its_first_request_is_not_waited_for(
    companions: Companions,
) -> None:
    first = companions.wait_until(0, 0.05)
    companions.connect(1)
    assert stands_still(first)
    companions.leave(1)
    assert time_of(first) == 0.05

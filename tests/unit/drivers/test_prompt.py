"""Wires that hang do not block the caller, on threads and on virtual time."""

import errno
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest

from companion.drivers.wires.bus import Transaction
from companion.drivers.wires.prompt import (
    MAX_AT_ONCE_S,
    PROBE_S,
    REQUEST_TIMEOUT_S,
    SHARE,
    PromptWires,
)
from sitl.sensors.ads1115 import Ads1115Device
from sitl.sensors.i2c import DeviceBus
from sitl.sensors.line import on_virtual_time
from tests.waiting import DEADLINE_S

READ = [Transaction(0x48, b"\x00", 2)]


class Stuck:
    """Wires whose I2C hangs on demand; SPI and serial ports answer."""

    def __init__(self) -> None:
        self.released = threading.Event()
        self.released.set()
        self.error: OSError | None = None
        self.request_count = 0

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        self.request_count += 1
        self.released.wait(DEADLINE_S)
        if self.error is not None:
            raise self.error
        return [bytes(t.count) for t in transactions]

    def exchange(self, device: str, data: bytes) -> bytes:
        return data

    def receive(self, port: str, baud: int) -> bytes:
        return port.encode()

    def close(self) -> None: ...


@pytest.fixture
def stuck() -> Iterator[Stuck]:
    stuck = Stuck()
    yield stuck
    stuck.released.set()


def test_answers_in_time_and_errors_are_passed_to_the_caller(stuck: Stuck) -> None:
    wires = PromptWires(stuck)
    assert wires.transfer(READ) == [bytes(2)]
    assert wires.exchange("/dev/spidev0.0", b"abc") == b"abc"
    assert wires.receive("/dev/ttyAMA1", 115200) == b"/dev/ttyAMA1"
    stuck.error = OSError(errno.EREMOTEIO, "no acknowledge")
    with pytest.raises(OSError, match="no acknowledge"):
        wires.transfer(READ)
    stuck.error = None
    assert wires.transfer(READ) == [bytes(2)]
    wires.close()


def test_requests_to_a_hung_bus_wait_once_and_the_other_wires_answer(
    stuck: Stuck,
) -> None:
    wires = PromptWires(stuck)
    wires.transfer(READ)
    stuck.released.clear()
    began_s = time.monotonic()
    for _ in range(100):
        with pytest.raises(TimeoutError):
            wires.transfer(READ)
    assert time.monotonic() - began_s < 50 * REQUEST_TIMEOUT_S
    assert stuck.request_count == 2
    assert wires.exchange("/dev/spidev0.0", b"abc") == b"abc"
    wires.close()


def test_a_bus_that_recovers_is_used_again_and_its_late_answer_is_dropped(stuck: Stuck) -> None:
    wires = PromptWires(stuck)
    wires.transfer(READ)
    stuck.released.clear()
    with pytest.raises(TimeoutError):
        wires.transfer([Transaction(0x48, b"\x00", 7)])
    stuck.released.set()
    until_s = time.monotonic() + DEADLINE_S
    while time.monotonic() < until_s:
        try:
            assert wires.transfer(READ) == [bytes(2)]
        except TimeoutError:
            continue
        break
    else:
        pytest.fail("the bus is never used again")
    wires.close()


class Slow:
    """A line with requests of a given duration, on its own clock."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.takes_s = 0.0
        self.error: OSError | None = None
        self.busy_until_s = 0.0
        self.request_count = 0

    @property
    def is_busy(self) -> bool:
        return self.now_s < self.busy_until_s

    def ask(self, request: Callable[[], Any], within_s: float) -> Any:
        self.request_count += 1
        if self.takes_s > within_s:
            self.busy_until_s = self.now_s + self.takes_s
            self.now_s += within_s
            raise TimeoutError(errno.ETIMEDOUT, "too late")
        self.now_s += self.takes_s
        if self.error is not None:
            raise self.error
        return request()

    def close(self) -> None: ...


def opened(line: Slow) -> PromptWires:
    wires = PromptWires(Stuck(), lambda: line, lambda: line.now_s)
    wires.transfer(READ)
    return wires


def seconds_taken(wires: PromptWires, line: Slow, requests: int) -> float:
    """Duration of the requests of one tick, s."""
    began_s = line.now_s
    for _ in range(requests):
        try:
            wires.transfer(READ)
        except OSError:
            continue
    return line.now_s - began_s


@pytest.mark.parametrize(
    ("takes_s", "number"),
    [(1.0, None), (0.05, errno.ETIMEDOUT), (0.0, errno.ETIMEDOUT), (1e9, None)],
)
def test_a_wire_that_has_timed_out_gets_no_request_until_the_next_probe(
    takes_s: float, number: int | None
) -> None:
    line = Slow()
    wires = opened(line)
    line.takes_s, line.request_count = takes_s, 0
    line.error = OSError(number, "timed out") if number else None
    assert seconds_taken(wires, line, 20) <= REQUEST_TIMEOUT_S + 1e-9
    assert line.request_count == 1
    line.takes_s, line.error = 0.0, None
    line.now_s = max(line.now_s + PROBE_S, line.busy_until_s) + 1e-6
    assert seconds_taken(wires, line, 3) == 0.0
    assert line.request_count == 4


@pytest.mark.parametrize("number", [errno.EREMOTEIO, errno.EIO, errno.EAGAIN, None])
@pytest.mark.parametrize("takes_s", [0.005, 0.02, 0.029, 0.2, 2.0])
def test_no_wire_takes_more_than_its_share_of_the_loop_time(
    takes_s: float, number: int | None
) -> None:
    line = Slow()
    wires = opened(line)
    line.takes_s = takes_s
    line.error = OSError(number, "failed") if number else None
    taken_s = []
    for _ in range(200):
        taken_s.append(seconds_taken(wires, line, 12))
        line.now_s += max(0.0, 0.05 - taken_s[-1])
    assert max(taken_s) <= MAX_AT_ONCE_S + 1e-9
    assert sum(taken_s) <= MAX_AT_ONCE_S + SHARE * line.now_s


def test_the_first_request_of_a_wire_has_a_longer_timeout() -> None:
    line = Slow()
    line.takes_s = 1.0
    assert opened(line).transfer is not None


def test_a_hung_bus_takes_the_same_time_on_virtual_time_as_on_a_thread() -> None:
    bus = DeviceBus({0x48: Ads1115Device(lambda channel, time_s: 1.0)})
    wires = on_virtual_time(bus)
    assert wires.transfer(READ)
    bus.hangs_s = 1.0
    began_s = bus.time_s
    for _ in range(10):
        with pytest.raises(TimeoutError):
            wires.transfer(READ)
    assert bus.time_s - began_s == pytest.approx(REQUEST_TIMEOUT_S)
    bus.hangs_s = 0.0
    bus.set_time(began_s + 0.9)
    with pytest.raises(TimeoutError):  # the kernel is still executing the first request
        wires.transfer(READ)
    bus.set_time(began_s + 1.01)
    assert wires.transfer(READ)

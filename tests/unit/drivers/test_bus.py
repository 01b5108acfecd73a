"""The kernel's I2C bus on a simulated adapter: transactions per call, waits and timeouts."""

import errno
import fcntl
import sys
import time
from types import SimpleNamespace
from typing import Any

import pytest

from companion.drivers.wires.bus import Transaction
from companion.drivers.wires.linux_i2c import LinuxI2cBus


class Adapter:
    """Replaces smbus2 and records its calls."""

    fd = 7

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.calls: list[str] = []
        self.ioctls: list[tuple[int, int, int]] = []
        monkeypatch.setattr(fcntl, "ioctl", lambda *request: self.ioctls.append(request))
        messages = SimpleNamespace(write=lambda a, data: data, read=lambda a, count: bytes(count))
        module = SimpleNamespace(i2c_msg=messages, SMBus=lambda path: self)
        monkeypatch.setitem(sys.modules, "smbus2", module)
        monkeypatch.setattr(time, "sleep", lambda s: self.calls.append(f"wait {s}") if s else None)

    def i2c_rdwr(self, *messages: Any) -> None:
        self.calls.append(f"{len(messages)} messages")


@pytest.fixture
def adapter(monkeypatch: pytest.MonkeyPatch) -> Adapter:
    return Adapter(monkeypatch)


def test_a_wait_separates_the_calls_before_and_after_it(adapter: Adapter) -> None:
    start, read = Transaction(0x48, b"\x01", wait_s=0.002), Transaction(0x48, b"\x00", 2)
    assert LinuxI2cBus("").transfer([start, read, read]) == [b"", bytes(2), bytes(2)]
    assert adapter.calls == ["1 messages", "wait 0.002", "4 messages"]


def test_no_call_has_more_messages_than_the_kernel_accepts(adapter: Adapter) -> None:
    read = Transaction(0x48, b"\x00", 2)
    assert len(LinuxI2cBus("").transfer([read] * 50)) == 50
    assert adapter.calls == ["42 messages", "42 messages", "16 messages"]


def test_the_kernels_timeout_for_a_hung_bus_is_shorter_than_a_tick(adapter: Adapter) -> None:
    LinuxI2cBus("")
    requests = {request: argument for fd, request, argument in adapter.ioctls if fd == adapter.fd}
    assert requests[0x0701] == 0  # I2C_RETRIES
    assert 2 <= requests[0x0702] <= 5  # I2C_TIMEOUT, tens of milliseconds


def test_an_adapter_without_a_timeout_setting_works(
    adapter: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*request: int) -> None:
        raise OSError(errno.ENOTTY, "Inappropriate ioctl for device")

    monkeypatch.setattr(fcntl, "ioctl", refuse)
    assert LinuxI2cBus("").transfer([Transaction(0x48, b"\x00", 2)]) == [bytes(2)]

"""An I2C bus with register-level devices on it."""

import errno
from collections.abc import Mapping, Sequence
from typing import Protocol

from companion.drivers.bus import Transaction

CLOCK_HZ = 400_000
BYTE_S = 9 / CLOCK_HZ
"""Eight bits and the acknowledge."""


class Device(Protocol):
    """A chip: a transfer writes some bytes, then reads some."""

    def write_read(self, data: bytes, count: int, time_s: float) -> bytes: ...


class DeviceBus:
    """The companion's `Bus` in this process. Transfers take bus time, as on copper."""

    def __init__(self, devices: Mapping[int, Device]) -> None:
        self._devices = devices
        self._time_s = 0.0
        self.is_broken = False
        """A fault for tests: nothing on the bus answers."""
        self.dead_addresses: set[int] = set()
        """A fault for tests: these chips do not answer."""

    def set_time(self, time_s: float) -> None:
        """The simulation has reached a time; the bus goes on from there."""
        self._time_s = max(self._time_s, time_s)

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        answers = []
        for t in transactions:
            self._time_s += (2 + len(t.data) + t.count) * BYTE_S
            device = self._devices.get(t.address)
            if device is None or self.is_broken or t.address in self.dead_addresses:
                raise OSError(errno.EREMOTEIO, f"no acknowledge from 0x{t.address:02x}")
            answers.append(device.write_read(t.data, t.count, self._time_s))
            self._time_s += t.wait_s
        return answers

    def close(self) -> None:
        """Nothing to give back."""

"""An I2C bus with register-level devices on it."""

import errno
from collections.abc import Mapping, Sequence
from typing import Protocol

from companion.drivers.bus import Transaction

BITS_PER_BYTE = 9
"""Eight and the acknowledge."""
CLOCK_HZ = 400_000


class Device(Protocol):
    """A chip: a transfer writes some bytes, then reads some."""

    def write_read(self, data: bytes, count: int, time_s: float) -> bytes: ...


class DeviceBus:
    """The companion's `Bus` in this process. Transfers and waits take bus time, as on copper."""

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
        return [self._carry_out(transaction) for transaction in transactions]

    def _carry_out(self, transaction: Transaction) -> bytes:
        address, data, count = transaction.address, transaction.data, transaction.count
        self._time_s += (2 + len(data) + count) * BITS_PER_BYTE / CLOCK_HZ
        device = self._devices.get(address)
        if device is None or self.is_broken or address in self.dead_addresses:
            raise OSError(errno.EREMOTEIO, f"no acknowledge from 0x{address:02x}")
        return device.write_read(data, count, self._time_s)

    def wait(self, duration_s: float) -> None:
        self._time_s += duration_s

    def close(self) -> None:
        """Nothing to give back."""

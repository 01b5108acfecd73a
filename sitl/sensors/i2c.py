"""Simulates the sensor board's wires: I2C with register-level devices, SPI, serial ports."""

import errno
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Protocol

from companion.drivers.wires.bus import Transaction
from companion.drivers.wires.linux_wires import SPI_CLOCK_HZ

CLOCK_HZ = 400_000
"""I2C fast mode."""
BYTE_S = 9 / CLOCK_HZ
"""Time of eight bits and the acknowledge, s."""
SPI_BYTE_S = 8 / SPI_CLOCK_HZ
"""Time of eight bits, s."""


class Device(Protocol):
    """An I2C chip: a transfer writes some bytes, then reads some."""

    def write_read(self, data: bytes, count: int, time_s: float) -> bytes: ...


class SpiDevice(Protocol):
    """An SPI chip behind its chip select."""

    def exchange(self, data: bytes, time_s: float) -> bytes: ...


class SerialDevice(Protocol):
    """A serial sensor that sends without a request."""

    def sent(self, time_s: float, baud: int) -> bytes:
        """Bytes that a port with that baud rate has received since the last call."""
        ...


class Multiplexer:
    """A TCA9548A: its control byte selects the connected branches among its eight."""

    def __init__(self, branches: Mapping[int, Mapping[int, Device]]) -> None:
        self._branches = branches
        self._connected = 0

    def write_read(self, data: bytes, count: int, time_s: float) -> bytes:
        if data:
            self._connected = data[-1]
        return bytes([self._connected])[:count]

    def behind(self, address: int) -> list[Device]:
        """Devices with that address on the connected branches."""
        return [
            devices[address]
            for channel, devices in self._branches.items()
            if self._connected >> channel & 1 and address in devices
        ]


NO_SPI: Mapping[str, SpiDevice] = MappingProxyType({})
NO_PORTS: Mapping[str, SerialDevice] = MappingProxyType({})


class DeviceBus:
    """Implements the companion's `Wires` in this process. Transfers take bus time, as on copper."""

    def __init__(
        self,
        devices: Mapping[int, Device],
        spi: Mapping[str, SpiDevice] = NO_SPI,
        ports: Mapping[str, SerialDevice] = NO_PORTS,
    ) -> None:
        self._devices = devices
        self._multiplexers = [d for d in devices.values() if isinstance(d, Multiplexer)]
        self._spi = spi
        self._ports = ports
        self._time_s = 0.0
        self.is_broken = False
        """A fault for tests: nothing on the wires responds."""
        self.dead_addresses: set[int] = set()
        """A fault for tests: these chips do not respond."""
        self.hangs_s = 0.0
        """A fault for tests: every transfer, exchange or receipt times out after this time, s."""
        self.hung_until_s = 0.0
        """Time until which a caller has waited for such a timeout, s."""

    @property
    def time_s(self) -> float:
        """Time at which the wires are free again, s."""
        return self._time_s

    def set_time(self, time_s: float) -> None:
        """Advance the bus to the simulation's time; the bus never goes back."""
        self._time_s = max(self._time_s, time_s)

    def set_back(self, time_s: float) -> None:
        """Reset the bus to the time at which the caller stopped waiting."""
        self._time_s = self.hung_until_s = time_s

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        self._hang()
        answers = []
        for t in transactions:
            self._time_s += (2 + len(t.data) + t.count) * BYTE_S
            devices = self._at(t.address)
            if not devices or self.is_broken or t.address in self.dead_addresses:
                raise OSError(errno.EREMOTEIO, f"no acknowledge from 0x{t.address:02x}")
            answers.append(_together(devices, t, self._time_s))
            self._time_s += t.wait_s
        return answers

    def _at(self, address: int) -> list[Device]:
        """All connected devices with that address; on copper each of them responds."""
        device = self._devices.get(address)
        devices = [] if device is None else [device]
        for multiplexer in self._multiplexers:
            devices += multiplexer.behind(address)
        return devices

    def _hang(self) -> None:
        if self.hangs_s:
            self._time_s += self.hangs_s
            self.hung_until_s = self._time_s
            raise TimeoutError(errno.ETIMEDOUT, "Connection timed out")

    def exchange(self, device: str, data: bytes) -> bytes:
        """Exchange bytes. All bits read one where no chip pulls the line low."""
        self._hang()
        if device not in self._spi:
            raise OSError(errno.ENOENT, f"there is no {device}")
        self._time_s += len(data) * SPI_BYTE_S
        if self.is_broken:
            return bytes([0xFF]) * len(data)
        return self._spi[device].exchange(data, self._time_s)

    def receive(self, port: str, baud: int) -> bytes:
        self._hang()
        if port not in self._ports:
            raise OSError(errno.ENOENT, f"there is no {port}")
        sent = self._ports[port].sent(self._time_s, baud)
        return b"" if self.is_broken else sent

    def close(self) -> None:
        """Do nothing: there are no resources to release."""


def _together(devices: Sequence[Device], transaction: Transaction, time_s: float) -> bytes:
    """The bytes read: a line is low as soon as one device pulls it low."""
    first, *others = [d.write_read(transaction.data, transaction.count, time_s) for d in devices]
    for other in others:
        first = bytes(a & b for a, b in zip(first, other, strict=True))
    return first

"""Wires of a Linux machine, such as a Raspberry Pi; each is opened at its first use."""

import time
from collections.abc import Sequence
from typing import Any

from companion.core.errors import SensorError
from companion.drivers.wires.bus import Bus, Transaction
from companion.drivers.wires.linux_i2c import LinuxI2cBus

SPI_CLOCK_HZ = 1_000_000
"""SPI clock. An MCP3008 at 2.7 V allows at most 1.35 MHz."""
RETRY_PERIOD_S = 1.0
"""Interval of attempts to open a port again, s. Chosen."""


class LinuxWires:
    """I2C by smbus2, SPI by python-periphery, serial ports by pyserial."""

    def __init__(self, i2c_path: str) -> None:
        self._i2c_path = i2c_path
        self._i2c: Bus | None = None
        self._spi: dict[str, Any] = {}
        self._ports: dict[str, Any] = {}
        self._retry_at_s: dict[str, float] = {}

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        if self._i2c is None:
            self._i2c = LinuxI2cBus(self._i2c_path)
        return self._i2c.transfer(transactions)

    def exchange(self, device: str, data: bytes) -> bytes:
        spi = self._spi.get(device) or self._spi.setdefault(device, _open_spi(device))
        return bytes(spi.transfer(data))

    def receive(self, port: str, baud: int) -> bytes:
        """Read a port. An adapter that was disconnected is opened again."""
        if port not in self._ports:
            if time.monotonic() < self._retry_at_s.get(port, 0.0):
                raise SensorError(f"{port} is gone")
            self._retry_at_s[port] = time.monotonic() + RETRY_PERIOD_S
            self._ports[port] = _open_port(port, baud)
        try:
            return bytes(self._ports[port].read(self._ports[port].in_waiting))
        except OSError:
            self._ports.pop(port).close()
            raise

    def close(self) -> None:
        for wire in (self._i2c, *self._spi.values(), *self._ports.values()):
            if wire is not None:
                wire.close()


def _open_spi(device: str) -> Any:
    from periphery import SPI, SPIError  # noqa: PLC0415 - few drones need it

    try:
        return SPI(device, 0, SPI_CLOCK_HZ)
    except SPIError as error:
        raise SensorError(
            f"{device}: {error.strerror}; enable SPI (raspi-config, Interface Options) "
            "and add this user to the group spi"
        ) from error


def _open_port(port: str, baud: int) -> Any:
    import termios  # noqa: PLC0415 - as the next one

    import serial  # noqa: PLC0415 - few drones need it

    try:
        return serial.Serial(port, baud, timeout=0, exclusive=True)
    except (OSError, termios.error) as error:  # SerialException is an OSError, termios' is not
        words = getattr(error, "strerror", None) or error.args[-1]
        raise SensorError(
            f"{port}: {words}; check the port's name, enable its UART "
            "(dtoverlay in config.txt) and add this user to the group dialout"
        ) from error

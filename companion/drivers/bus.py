"""The I2C bus as the drivers see it, and its two bodies: Linux's and SITL's.

`open_bus("/dev/i2c-1")` is the real one, `open_bus("sitl://127.0.0.1:5790")` the one that SITL
serves; nothing above this file can tell them apart.
"""

import time
from typing import Protocol

from companion.errors import SensorError


class Bus(Protocol):
    """One I2C controller. Every transfer may raise OSError: no acknowledge, bus gone."""

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write `data` to the device at `address`, then read `count` bytes (repeated start)."""
        ...

    def wait(self, duration_s: float) -> None:
        """Let a conversion finish; on SITL's bus this is virtual time."""
        ...

    def close(self) -> None: ...


class LinuxI2cBus:
    """An I2C adapter of the Linux kernel, such as /dev/i2c-1 on a Raspberry Pi."""

    def __init__(self, path: str) -> None:
        import smbus2  # noqa: PLC0415 - absent on machines without I2C

        self._i2c_msg = smbus2.i2c_msg
        try:
            self._bus = smbus2.SMBus(path)
        except OSError as error:
            raise SensorError(
                f"{path}: {error.strerror}; enable I2C (raspi-config, Interface Options) "
                "and add this user to the group i2c"
            ) from error

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        messages = [self._i2c_msg.write(address, data)] if data else []
        if count:
            messages.append(self._i2c_msg.read(address, count))
        self._bus.i2c_rdwr(*messages)
        return bytes(messages[-1]) if count else b""

    def wait(self, duration_s: float) -> None:
        time.sleep(duration_s)

    def close(self) -> None:
        self._bus.close()


def open_bus(url: str) -> Bus:
    """The bus at "/dev/i2c-N" or "sitl://HOST:PORT".

    Raises:
        SensorError: it cannot be opened; names the url and the remedy.
    """
    if url.startswith("sitl://"):
        from companion.drivers.served_bus import ServedBus  # noqa: PLC0415 - it implements Bus

        host, port = url.removeprefix("sitl://").rsplit(":", 1)
        return ServedBus(host, int(port))
    return LinuxI2cBus(url)

"""The I2C bus as the drivers see it, and its two bodies: Linux's and SITL's.

`open_bus("/dev/i2c-1")` is the real one, `open_bus("sitl://127.0.0.1:5790")` the one that SITL
serves; nothing above this file can tell them apart.
"""

import time
from collections.abc import Sequence
from typing import Protocol

from companion.errors import SensorError
from companion.values import value


@value
class Transaction:
    """Write `data` to the device at `address`, read `count` bytes (repeated start), then wait."""

    address: int
    data: bytes
    count: int = 0
    wait_s: float = 0.0
    """For a conversion to finish, before the next transaction; on SITL's bus virtual time."""


class Bus(Protocol):
    """One I2C controller."""

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        """Carry out transactions one after the other; the bytes read by each.

        Raises:
            OSError: a device did not acknowledge, and what came after it was not done; or the
                bus is gone.
        """
        ...

    def close(self) -> None: ...


MOST_TRANSACTIONS = 21
"""The kernel takes 42 messages a call (I2C_RDWR_IOCTL_MAX_MSGS): a write and a read each."""


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

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        answers: list[bytes] = []
        batch: list[Transaction] = []
        for transaction in transactions:
            batch.append(transaction)
            if transaction.wait_s > 0 or len(batch) == MOST_TRANSACTIONS:
                answers += self._transfer(batch)
                batch.clear()
                time.sleep(transaction.wait_s)
        return answers + (self._transfer(batch) if batch else [])

    def _transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        writes = [self._i2c_msg.write(t.address, t.data) for t in transactions]
        reads = [self._i2c_msg.read(t.address, t.count) if t.count else None for t in transactions]
        pairs = zip(writes, reads, strict=True)
        self._bus.i2c_rdwr(*[message for pair in pairs for message in pair if message is not None])
        return [b"" if read is None else bytes(read) for read in reads]

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

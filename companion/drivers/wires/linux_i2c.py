"""I2C adapters of the Linux kernel, by smbus2."""

import time
from collections.abc import Sequence
from contextlib import suppress

from companion.core.errors import SensorError
from companion.drivers.wires.bus import Transaction

MAX_TRANSACTIONS = 21
"""The kernel accepts 42 messages a call (I2C_RDWR_IOCTL_MAX_MSGS): a write and a read each."""
I2C_RETRIES, I2C_TIMEOUT = 0x0701, 0x0702
"""Requests of linux/i2c-dev.h."""
TIMEOUT_10_MS = 5
"""Timeout of a call, in the kernel's unit of 10 ms. Its default is a second; the longest valid call
takes 20 ms."""


class LinuxI2cBus:
    """An I2C adapter of the Linux kernel, such as /dev/i2c-1 on a Raspberry Pi."""

    def __init__(self, path: str) -> None:
        import fcntl  # noqa: PLC0415 - as the next one

        import smbus2  # noqa: PLC0415 - absent on machines without I2C

        self._i2c_msg = smbus2.i2c_msg
        try:
            self._bus = smbus2.SMBus(path)
        except OSError as error:
            raise SensorError(
                f"{path}: {error.strerror}; enable I2C (raspi-config, Interface Options) "
                "and add this user to the group i2c"
            ) from error
        with suppress(OSError):  # an adapter without such a limit: `prompt` has one for all wires
            for request, argument in ((I2C_RETRIES, 0), (I2C_TIMEOUT, TIMEOUT_10_MS)):
                fcntl.ioctl(self._bus.fd, request, argument)  # type: ignore[arg-type] # it is open

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        answers: list[bytes] = []
        batch: list[Transaction] = []
        for transaction in transactions:
            batch.append(transaction)
            if transaction.wait_s > 0 or len(batch) == MAX_TRANSACTIONS:
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

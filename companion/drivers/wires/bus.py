"""Interface of the wires for drivers: I2C, SPI and serial."""

from collections.abc import Sequence
from typing import Protocol

from companion.core.values import value


@value
class Transaction:
    """Write `data` to the device at `address`, read `count` bytes (repeated start), then wait."""

    address: int
    data: bytes
    count: int = 0
    wait_s: float = 0.0
    """Wait before the next transaction, for a conversion; on SITL's bus this is virtual time."""


class Bus(Protocol):
    """One I2C controller."""

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        """Execute transactions in order; returns the bytes read by each.

        Raises:
            OSError: a device did not acknowledge, and later transactions were not executed; or the
        bus is
                disconnected or does not answer in time.
        """
        ...

    def close(self) -> None: ...


class Spi(Protocol):
    """SPI devices by name, such as /dev/spidev0.0: bus and chip select."""

    def exchange(self, device: str, data: bytes) -> bytes:
        """Shift `data` out and as many bytes in, in one selection of the chip.

        Raises:
            OSError: the device does not exist.
        """
        ...


class Uart(Protocol):
    """Serial ports by name, such as /dev/ttyAMA1."""

    def receive(self, port: str, baud: int) -> bytes:
        """All bytes received since the last call; never blocks.

        Raises:
            OSError: the port does not exist.
        """
        ...


class Wires(Bus, Spi, Uart, Protocol):
    """All wires for sensors."""

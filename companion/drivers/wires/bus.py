"""The wires as the drivers see them: I2C, SPI and serial."""

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
    """For a conversion to finish, before the next transaction; on SITL's bus virtual time."""


class Bus(Protocol):
    """One I2C controller."""

    def transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        """Carry out transactions one after the other; the bytes read by each.

        Raises:
            OSError: a device did not acknowledge, and what came after it was not done; or the
                bus is gone, or does not answer in time.
        """
        ...

    def close(self) -> None: ...


class Spi(Protocol):
    """SPI devices by name, such as /dev/spidev0.0: bus and chip select."""

    def exchange(self, device: str, data: bytes) -> bytes:
        """Shift `data` out and as many bytes in, in one selection of the chip.

        Raises:
            OSError: the device is not there.
        """
        ...


class Uart(Protocol):
    """Serial ports by name, such as /dev/ttyAMA1."""

    def receive(self, port: str, baud: int) -> bytes:
        """All that has come in since the last call; never waits.

        Raises:
            OSError: the port is not there.
        """
        ...


class Wires(Bus, Spi, Uart, Protocol):
    """All that sensors can be connected to."""

"""Microchip MCP3008: eight single-ended 10-bit channels over SPI.

Three bytes each way, datasheet DS21295, figure 6-1: a start bit and the channel out; a null bit and
ten bits of the result in.
"""

import errno
from collections.abc import Sequence

from companion.core.errors import SensorError
from companion.drivers.wires.bus import Spi

START = 0x01
"""First byte out: seven leading zeros and the start bit (DS21295, section 6.1)."""
SINGLE_ENDED = 0x80
"""SGL/DIFF bit of the second byte out: convert one input against ground (DS21295, section 5)."""
CHANNEL_SHIFT = 4
"""Position of D2 to D0, the input's number, in the second byte out, bits (DS21295, section 5)."""
NULL_BIT = 0x04
"""Bit 2 of the second byte in. The chip drives it to zero (DS21295, section 6.1)."""
HIGH_BITS = 0x03
"""Bits 9 and 8 of the result, at the end of the second byte in (DS21295, section 6.1)."""
COUNTS = 1024
"""Counts of the reference voltage: ten bits (DS21295)."""


def request(channel: int) -> bytes:
    """Request to convert one channel against ground."""
    return bytes([START, SINGLE_ENDED | channel << CHANNEL_SHIFT, 0])


def counts(answer: bytes) -> int:
    """Result of a conversion, 0 to 1023.

    Raises:
        OSError: the null bit is missing, so there is no chip.
    """
    if len(answer) != 3 or answer[1] & NULL_BIT:
        raise OSError(errno.EREMOTEIO, f"no null bit in {answer.hex(' ')}")
    return (answer[1] & HIGH_BITS) << 8 | answer[2]


class Mcp3008:
    """One chip.

    Raises:
        SensorError: nothing answers. The chip has no identity, so another chip with the same
    protocol
            is not detected.
    """

    def __init__(self, spi: Spi, device: str, reference_v: float) -> None:
        self._spi = spi
        self._device = device
        self._volts_per_count = reference_v / COUNTS
        try:
            self.volts([0])
        except SensorError:
            raise
        except OSError as error:
            raise SensorError(
                f"no MCP3008 at {device} ({error}); check wiring, chip select and "
                "sensors.ranges.*.device"
            ) from error

    def volts(self, channels: Sequence[int]) -> dict[int, float]:
        """Voltage of each input.

        Raises:
            OSError: the chip does not answer.
        """
        return {
            channel: counts(self._spi.exchange(self._device, request(channel)))
            * self._volts_per_count
            for channel in channels
        }

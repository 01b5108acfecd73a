"""Emulates the MCP3008 at its SPI bus.

All constants are those of the datasheet (DS21295), not of the companion's driver.
"""

from collections.abc import Callable

EXCHANGE_BYTES = 3
"""Bytes of one conversion with 8-bit words (DS21295, section 6.1)."""
START_BYTE = 0x01
"""First byte in: seven leading zeros and the start bit (DS21295, section 6.1)."""
SINGLE_ENDED = 0x80
"""SGL/DIFF bit of the second byte in: convert one input against ground (DS21295, section 5)."""
CHANNEL_SHIFT, CHANNEL_BITS = 4, 0x07
"""D2 to D0, the input's number, in bits 6 to 4 of the second byte in (DS21295, section 5)."""
UNDRIVEN = 0xFF
"""Byte out while no chip drives the line. Chosen: the line has a pull-up."""
UNDRIVEN_BITS = 0xF8
"""Bits of the second byte out before the null bit, which is bit 2 and zero. Chosen: as UNDRIVEN."""
HIGH_BITS = 0x03
"""Bits 9 and 8 of the result, at the end of the second byte out (DS21295, section 6.1)."""
COUNTS = 1024
"""Counts of the reference voltage: ten bits (DS21295)."""
Voltage = Callable[[int, float], float]
"""(channel, time_s) -> voltage at that input, V."""


class Mcp3008Device:
    """Three-byte exchanges, single-ended; anything else reads ones, like an idle line."""

    def __init__(self, voltage: Voltage, reference_v: float) -> None:
        self._voltage = voltage
        self._reference_v = reference_v

    def exchange(self, data: bytes, time_s: float) -> bytes:
        if len(data) != EXCHANGE_BYTES or data[0] != START_BYTE or not data[1] & SINGLE_ENDED:
            return bytes([UNDRIVEN]) * len(data)
        channel = data[1] >> CHANNEL_SHIFT & CHANNEL_BITS
        counts = int(self._voltage(channel, time_s) / self._reference_v * COUNTS)
        counts = max(0, min(COUNTS - 1, counts))
        return bytes([UNDRIVEN, UNDRIVEN_BITS | counts >> 8 & HIGH_BITS, counts & 0xFF])

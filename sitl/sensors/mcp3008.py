"""Emulates the MCP3008 at its SPI bus."""

from collections.abc import Callable

from companion.drivers.chips.mcp3008 import CHANNEL_SHIFT, COUNTS, HIGH_BITS, SINGLE_ENDED, START

Voltage = Callable[[int, float], float]
"""(channel, time_s) -> voltage at that input, V."""


class Mcp3008Device:
    """Three-byte exchanges, single-ended; anything else reads ones, like an idle line."""

    def __init__(self, voltage: Voltage, reference_v: float) -> None:
        self._voltage = voltage
        self._reference_v = reference_v

    def exchange(self, data: bytes, time_s: float) -> bytes:
        if len(data) != 3 or data[0] != START or not data[1] & SINGLE_ENDED:
            return bytes([0xFF]) * len(data)
        channel = data[1] >> CHANNEL_SHIFT & 0x07
        counts = int(self._voltage(channel, time_s) / self._reference_v * COUNTS)
        counts = max(0, min(COUNTS - 1, counts))
        return bytes([0xFF, 0xF8 | counts >> 8 & HIGH_BITS, counts & 0xFF])

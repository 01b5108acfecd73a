"""Emulates the ADS1115 at its bus: config and conversion registers, one conversion at a time."""

from collections.abc import Callable

from companion.drivers.chips.ads1115 import (
    MUX_SINGLE_ENDED,
    MUX_STEP,
    REG_CONFIG,
    REG_CONVERSION,
    START,
    VOLTS_PER_COUNT,
)

CONVERSION_S = 1 / 860
"""Conversion time at 860 samples per second (ADS1115 datasheet), s."""
RESET_CONFIG = 0x8583
"""Config register after reset (ADS1115 datasheet)."""
Voltage = Callable[[int, float], float]
"""(channel, time_s) -> voltage at that input, V."""


class Ads1115Device:
    """The functions that the driver uses: single-ended, ±4.096 V, single-shot."""

    def __init__(self, voltage: Voltage) -> None:
        self._voltage = voltage
        self._pointer = REG_CONVERSION
        self._config = RESET_CONFIG
        self._counts = 0
        self._done_at_s = float("-inf")
        self._next_counts = 0

    def write_read(self, data: bytes, count: int, time_s: float) -> bytes:
        if data:
            self._pointer = data[0] & 0x03
        if len(data) >= 3 and self._pointer == REG_CONFIG:
            self._configure(int.from_bytes(data[1:3], "big"), time_s)
        if not count:
            return b""
        return self._register(time_s).to_bytes(2, "big")[:count].ljust(count, b"\xff")

    def _configure(self, word: int, time_s: float) -> None:
        self._config = word
        if word & START and time_s >= self._done_at_s:
            self._finish(time_s)
            channel = (word - MUX_SINGLE_ENDED) // MUX_STEP & 0x03
            counts = round(self._voltage(channel, time_s) / VOLTS_PER_COUNT)
            self._next_counts = max(-32768, min(32767, counts))
            self._done_at_s = time_s + CONVERSION_S

    def _finish(self, time_s: float) -> None:
        if time_s >= self._done_at_s:
            self._counts = self._next_counts

    def _register(self, time_s: float) -> int:
        self._finish(time_s)
        if self._pointer == REG_CONVERSION:
            return self._counts & 0xFFFF
        if self._pointer == REG_CONFIG:
            idle = START if time_s >= self._done_at_s else 0
            return self._config & ~START | idle
        return 0

"""Emulates the ADS1115 at its bus: config and conversion registers, one conversion at a time.

All constants are those of the datasheet (SBAS444), not of the companion's driver.
"""

from collections.abc import Callable

REG_CONVERSION = 0x00
"""Address of the conversion register: the latest result, two's complement (SBAS444, pointer)."""
REG_CONFIG = 0x01
"""Address of the config register (SBAS444, pointer register)."""
POINTER_BITS = 0x03
"""Bits of the pointer byte that select a register (SBAS444, pointer register)."""
OS = 0x8000
"""Bit 15 of the config register. Written 1: start a conversion. Read 1: none runs (SBAS444)."""
MUX_SHIFT, MUX_BITS = 12, 0x7
"""Input multiplexer, bits 14 to 12 of the config register (SBAS444)."""
MUX_AIN0_GND = 0x4
"""Value of MUX for AIN0 against ground; those of AIN1 to AIN3 follow, lower ones are differential
(SBAS444)."""
PGA_SHIFT, PGA_BITS = 9, 0x7
"""Gain amplifier, bits 11 to 9 of the config register (SBAS444)."""
FULL_SCALE_V = (6.144, 4.096, 2.048, 1.024, 0.512, 0.256, 0.256, 0.256)
"""Full scale by the value of PGA, V (SBAS444)."""
FULL_SCALE_COUNTS = 32768
"""Counts of the full scale: 16 bits, two's complement (SBAS444)."""
RATE_SHIFT, RATE_BITS = 5, 0x7
"""Data rate, bits 7 to 5 of the config register (SBAS444)."""
RATES_HZ = (8, 16, 32, 64, 128, 250, 475, 860)
"""Conversions per second by the value of the data rate, Hz (SBAS444); without clock error."""
RESET_CONFIG = 0x8583
"""Config register after reset (SBAS444)."""
Voltage = Callable[[int, float], float]
"""(channel, time_s) -> voltage at that input, V."""


class Ads1115Device:
    """Single-shot conversions. A differential input, which is not emulated, reads zero."""

    def __init__(self, voltage: Voltage) -> None:
        self._voltage = voltage
        self._pointer = REG_CONVERSION
        self._config = RESET_CONFIG
        self._counts = 0
        self._done_at_s = float("-inf")
        self._next_counts = 0

    def write_read(self, data: bytes, count: int, time_s: float) -> bytes:
        if data:
            self._pointer = data[0] & POINTER_BITS
        if len(data) >= 3 and self._pointer == REG_CONFIG:
            self._configure(int.from_bytes(data[1:3], "big"), time_s)
        if not count:
            return b""
        return self._register(time_s).to_bytes(2, "big")[:count].ljust(count, b"\xff")

    def _configure(self, word: int, time_s: float) -> None:
        self._config = word
        if word & OS and time_s >= self._done_at_s:
            self._finish(time_s)
            self._next_counts = self._converted(word, time_s)
            self._done_at_s = time_s + 1 / RATES_HZ[word >> RATE_SHIFT & RATE_BITS]

    def _converted(self, word: int, time_s: float) -> int:
        """Counts of the input and at the gain that the config register selects."""
        mux = word >> MUX_SHIFT & MUX_BITS
        if mux < MUX_AIN0_GND:
            return 0
        volts_per_count = FULL_SCALE_V[word >> PGA_SHIFT & PGA_BITS] / FULL_SCALE_COUNTS
        counts = round(self._voltage(mux - MUX_AIN0_GND, time_s) / volts_per_count)
        return max(-FULL_SCALE_COUNTS, min(FULL_SCALE_COUNTS - 1, counts))

    def _finish(self, time_s: float) -> None:
        if time_s >= self._done_at_s:
            self._counts = self._next_counts

    def _register(self, time_s: float) -> int:
        self._finish(time_s)
        if self._pointer == REG_CONVERSION:
            return self._counts & 0xFFFF
        if self._pointer == REG_CONFIG:
            idle = OS if time_s >= self._done_at_s else 0
            return self._config & ~OS | idle
        return 0

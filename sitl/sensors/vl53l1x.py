"""Emulates the VL53L1X at its bus: identity, start, data ready, result."""

from companion.drivers.chips.vl53l1x import (
    BOOTED,
    MODEL_ID,
    RANGE_AT,
    REG_BOOTED,
    REG_DATA_READY,
    REG_INTERRUPT_CLEAR,
    REG_MODE_START,
    REG_MODEL_ID,
    REG_OSCILLATOR,
    REG_PERIOD,
    REG_RESULT,
    RESULT_BYTES,
    STREAM_AT,
    TIMED,
    VALID,
)
from sitl.sensors.time_of_flight import TofUnit

BOOT_S = 1.2e-3
"""Boot time, s."""
NO_SIGNAL = 4
"""Range status without a return."""
OSCILLATOR = 0x0320
REGISTERS = 0x0200
"""Emulated register addresses."""


class Vl53l1xDevice:
    """Timed ranging. The chip measures only after its period is set and ranging is started."""

    def __init__(self, unit: TofUnit) -> None:
        self._unit = unit
        self._registers = bytearray(REGISTERS)
        self._put(REG_MODEL_ID, MODEL_ID, 2)
        self._put(REG_OSCILLATOR, OSCILLATOR, 2)
        self._cleared = 0
        self._booted_s = BOOT_S

    def power_cycle(self, time_s: float) -> None:
        """A fault for tests: the chip loses its settings."""
        self._registers[REG_PERIOD : REG_MODE_START + 1] = bytes(REG_MODE_START + 1 - REG_PERIOD)
        self._booted_s = time_s + BOOT_S

    def write_read(self, data: bytes, count: int, time_s: float) -> bytes:
        if self._unit.is_unplugged:
            raise OSError("unplugged")
        register = int.from_bytes(data[:2], "big") % REGISTERS
        for offset, value in enumerate(data[2:]):
            self._write(register + offset, value, time_s)
        if not count:
            return b""
        self._measure(time_s)
        return bytes(self._registers[register : register + count]).ljust(count, b"\x00")

    def _write(self, register: int, value: int, time_s: float) -> None:
        if register < REG_BOOTED:  # registers from here on are read-only
            self._registers[register] = value
        if register in (REG_INTERRUPT_CLEAR, REG_MODE_START):
            self._cleared = self._unit.count(time_s)

    def _measure(self, time_s: float) -> None:
        self._registers[REG_BOOTED] = BOOTED if time_s >= self._booted_s else 0
        period = self._registers[REG_PERIOD : REG_PERIOD + 4]
        running = self._registers[REG_MODE_START] == TIMED and any(period)
        ready = running and self._unit.count(time_s) > self._cleared
        self._registers[REG_DATA_READY] = 0x02 | ready
        if not ready:
            return
        distance_m = self._unit.distance_m(time_s)
        result = bytearray(RESULT_BYTES)
        result[0] = NO_SIGNAL if distance_m is None else VALID
        result[STREAM_AT] = self._unit.measured & 0xFF
        result[RANGE_AT:] = round(1000 * (distance_m or 0.0)).to_bytes(2, "big")
        self._registers[REG_RESULT : REG_RESULT + RESULT_BYTES] = result

    def _put(self, register: int, value: int, size: int) -> None:
        self._registers[register : register + size] = value.to_bytes(size, "big")

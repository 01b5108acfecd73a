"""Emulates the VL53L1X at its bus: identity, start, data ready, result.

ST documents the registers by its driver (STSW-IMG009). Addresses and values here are those, with
their names there; none comes from the companion's driver.
"""

from sitl.sensors.time_of_flight import TofUnit

REG_MODEL_ID, MODEL_ID = 0x010F, 0xEACC
"""IDENTIFICATION__MODEL_ID: model and module type, two bytes."""
REG_BOOTED, BOOTED = 0x00E5, 0x01
"""FIRMWARE__SYSTEM_STATUS, and its value once the firmware runs."""
REG_OSCILLATOR, OSCILLATOR = 0x00DE, 0x0320
"""RESULT__OSC_CALIBRATE_VAL, two bytes: ticks of the slow clock per millisecond in ten bits; and
this chip's. Chosen."""
REG_PERIOD, PERIOD_BYTES = 0x006C, 4
"""SYSTEM__INTERMEASUREMENT_PERIOD, ticks of the slow clock."""
REG_DATA_READY, DATA_READY = 0x0031, 0x01
"""GPIO__TIO_HV_STATUS, and its bit for the state of the interrupt pin, here active high."""
OTHER_STATUS_BITS = 0x02
"""Bits of GPIO__TIO_HV_STATUS beside the interrupt. Chosen: drivers must mask them."""
REG_INTERRUPT_CLEAR = 0x0086
"""SYSTEM__INTERRUPT_CLEAR: a write clears the interrupt until the next measurement."""
REG_MODE_START, TIMED = 0x0087, 0x40
"""SYSTEM__MODE_START, and its value that starts ranging at the interval of REG_PERIOD."""
REG_RANGE_STATUS = 0x0089
"""RESULT__RANGE_STATUS: first byte of a result."""
RANGE_COMPLETE, NO_SIGNAL = 9, 4
"""Range status with a valid distance, and without enough returned light."""
REG_STREAM_COUNT = 0x008B
"""RESULT__STREAM_COUNT: number of the measurement, eight bits."""
REG_DISTANCE, DISTANCE_BYTES = 0x0096, 2
"""RESULT__FINAL_CROSSTALK_CORRECTED_RANGE_MM_SD0: distance, mm, the high byte first."""
BOOT_S = 1.2e-3
"""Boot time, s. The companion's driver waits as long between two checks."""
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
        period = self._registers[REG_PERIOD : REG_PERIOD + PERIOD_BYTES]
        running = self._registers[REG_MODE_START] == TIMED and any(period)
        ready = running and self._unit.count(time_s) > self._cleared
        self._registers[REG_DATA_READY] = OTHER_STATUS_BITS | (DATA_READY if ready else 0)
        if not ready:
            return
        distance_m = self._unit.distance_m(time_s)
        status = NO_SIGNAL if distance_m is None else RANGE_COMPLETE
        self._put(REG_RANGE_STATUS, status, 1)
        self._put(REG_STREAM_COUNT, self._unit.measured & 0xFF, 1)
        self._put(REG_DISTANCE, round(1000 * (distance_m or 0.0)), DISTANCE_BYTES)

    def _put(self, register: int, value: int, size: int) -> None:
        self._registers[register : register + size] = value.to_bytes(size, "big")

"""STMicroelectronics VL53L1X: time of flight, every 40 ms by the chip's own clock, over I2C.

Register numbers are 16-bit, values big-endian. ST documents the registers only by its driver
(STSW-IMG009); this module writes only registers whose names state their purpose. Every chip starts
at address 0x29, hence the TCA9548A, which selects its branches by one byte.
"""

from collections.abc import Sequence

from companion.core.errors import SensorError
from companion.core.messages import RangeReading
from companion.drivers.chips.time_of_flight import VL53L1X
from companion.drivers.readings import NOTHING, TOO_NEAR, Latest
from companion.drivers.wires.bus import Bus, Transaction

REG_MODEL_ID, MODEL_ID = 0x010F, 0xEACC
"""Model and module type."""
REG_BOOTED, BOOTED = 0x00E5, 0x01
"""FIRMWARE__SYSTEM_STATUS, and its bit that is set once the firmware runs (STSW-IMG009)."""
REG_OSCILLATOR = 0x00DE
"""Ticks of the slow clock per millisecond, approximately; ten bits."""
REG_PERIOD = 0x006C
"""SYSTEM__INTERMEASUREMENT_PERIOD, ticks of the slow clock (STSW-IMG009)."""
REG_INTERRUPT_CLEAR = 0x0086
"""SYSTEM__INTERRUPT_CLEAR: a write clears the interrupt until the next measurement
(STSW-IMG009)."""
REG_MODE_START, TIMED, STOPPED = 0x0087, 0x40, 0x00
"""SYSTEM__MODE_START, and its values: ranging at the interval of REG_PERIOD, and no ranging
(STSW-IMG009)."""
REG_DATA_READY = 0x0031
"""GPIO__TIO_HV_STATUS: bit 0 is the state of the interrupt pin, here active high (STSW-IMG009)."""
REG_RESULT = 0x0089
"""RESULT__RANGE_STATUS: first byte of a result (STSW-IMG009)."""
RESULT_BYTES, STREAM_AT, RANGE_AT = 15, 2, 13
"""Result registers, from the status to the distance in mm (0x0096); the counter of measurements is
at 0x008B, eight bits."""
CLOCK_CORRECTION = 1.075
"""Ratio of the value of REG_PERIOD to the ticks counted from REG_OSCILLATOR (STSW-IMG009)."""
SILENT_S = 0.25
"""Time without a measurement after which the chip is configured again, s. Chosen."""
NO_BRANCH = 0x00
"""Control byte of the TCA9548A that disconnects all branches."""
BOOT_S, BOOT_TRIES = 1.2e-3, 10
"""Wait after each check of REG_BOOTED, s: the chip's boot time; and number of checks, chosen."""

LONG_DISTANCE_33_MS = (
    (0x0030, 0x01, 1),  # GPIO: interrupt active high
    (0x0046, 0x20, 1),  # interrupt at each new measurement
    (0x004B, 0x0A, 1),  # phase calibration: timeout
    (0x0057, 0x38, 1),  # detectors' aperture attenuation
    (0x005E, 0x0060, 2),  # phase A: timeout for a budget of 33 ms
    (0x0060, 0x0F, 1),  # phase A: pulse period, long distance
    (0x0061, 0x006E, 2),  # phase B: timeout for a budget of 33 ms
    (0x0063, 0x0D, 1),  # phase B: pulse period, long distance
    (0x0064, 0x0168, 2),  # largest sigma: 90 mm, in quarters
    (0x0066, 0x0080, 2),  # least rate of returned photons: 1 Mcps, in 1/128
    (0x0069, 0xB8, 1),  # largest valid phase, long distance
    (0x0078, 0x0F0D, 2),  # windows of phases A and B
    (0x007A, 0x0E0E, 2),  # initial phases of A and B
    (0x0080, 0xFF, 1),  # region of interest: all 16 × 16 detectors
    (0x0081, 0x9B, 1),  # sequence: calibrations, both choices of detectors, ranging
)
"""Register, value and number of bytes: long distance mode with a timing budget of 33 ms
(STSW-IMG009)."""
VALID = 9
"""Range status with a valid distance (STSW-IMG009)."""
MEANINGS = {8: TOO_NEAR, **dict.fromkeys((4, 5, 7), NOTHING)}
"""Status values without a distance: clipped at the minimum distance; no signal, phase out of
bounds, or wrapped around, all beyond the range. All others are faults: 6 is an obstacle with too
much noise."""


def write(address: int, register: int, value: int, size: int) -> Transaction:
    return Transaction(address, register.to_bytes(2, "big") + value.to_bytes(size, "big"))


def read(address: int, register: int, size: int, wait_s: float = 0.0) -> Transaction:
    return Transaction(address, register.to_bytes(2, "big"), size, wait_s)


class Vl53l1x:
    """One sensor, on branch `mux` (address, channel) of a multiplexer if there is one.

    `other_muxes`: addresses of multiplexers whose branches must be disconnected.

    Raises:
        SensorError: no VL53L1X answers at the address.
    """

    model = VL53L1X

    def __init__(
        self,
        bus: Bus,
        address: int,
        mux: tuple[int, int] | None,
        other_muxes: Sequence[int] = (),
    ) -> None:
        self._bus = bus
        self._address = address
        self._select = [Transaction(other, bytes([NO_BRANCH])) for other in other_muxes]
        if mux:
            self._select.append(Transaction(mux[0], bytes([1 << mux[1]])))
        self._latest = Latest()
        self._configured_s: float | None = None
        self._stream: int | None = None
        where = f"0x{address:02x}" + (f" behind 0x{mux[0]:02x} branch {mux[1]}" if mux else "")
        try:
            found = self._number(REG_MODEL_ID)
        except SensorError:
            raise
        except OSError as error:
            raise SensorError(f"no VL53L1X at {where} ({error}); check wiring and XSHUT") from error
        if found != MODEL_ID:
            raise SensorError(
                f"the chip at {where} is no VL53L1X (its model ID is 0x{found:04x}, not 0xeacc); "
                "check the addresses in [sensors.ranges]"
            )

    def read(self, time_s: float) -> RangeReading | None:
        """The latest reading; None if the sensor is silent, which restarts it."""
        try:
            if self._configured_s is None:
                self._configure()
                self._configured_s = time_s
            self._latest.note(time_s, self._measured())
        except OSError:
            self._configured_s = None  # it may have been power-cycled
            return None
        if time_s - max(self._latest.time_s, self._configured_s) > SILENT_S:
            self._configured_s = None
        return self._latest.at(time_s)

    def _configure(self) -> None:
        booted = read(self._address, REG_BOOTED, 1, BOOT_S)
        if not any(self._transfer([booted])[0][0] & BOOTED for _ in range(BOOT_TRIES)):
            raise OSError("it does not boot")
        ticks_per_ms = self._number(REG_OSCILLATOR) & 0x3FF
        period = round(ticks_per_ms * 1e3 * VL53L1X.period_s * CLOCK_CORRECTION)
        settings = (
            (REG_MODE_START, STOPPED, 1),
            *LONG_DISTANCE_33_MS,
            (REG_PERIOD, period, 4),
            (REG_INTERRUPT_CLEAR, 0x01, 1),
            (REG_MODE_START, TIMED, 1),
        )
        self._transfer([write(self._address, *setting) for setting in settings])

    def _measured(self) -> RangeReading | None:
        (ready,) = self._transfer([read(self._address, REG_DATA_READY, 1)])
        if not ready[0] & 0x01:
            return None
        result, _ = self._transfer(
            [
                read(self._address, REG_RESULT, RESULT_BYTES),
                write(self._address, REG_INTERRUPT_CLEAR, 0x01, 1),
            ]
        )
        if result[STREAM_AT] == self._stream:
            return None  # it hangs and repeats the last result
        self._stream = result[STREAM_AT]
        status = result[0] & 0x1F
        if status == VALID:
            return VL53L1X.reading(int.from_bytes(result[RANGE_AT:], "big") * 1e-3)
        return MEANINGS.get(status)

    def _number(self, register: int) -> int:
        return int.from_bytes(self._transfer([read(self._address, register, 2)])[0], "big")

    def _transfer(self, transactions: Sequence[Transaction]) -> list[bytes]:
        return self._bus.transfer([*self._select, *transactions])[len(self._select) :]

"""STMicroelectronics LSM9DS1: its gyro, read from the chip's FIFO so that no sample is lost.

Registers: datasheet DocID025715, section 7. The chip is mounted with its z axis up, so its positive
rate is counter-clockwise seen from above. FRD yaw is clockwise, hence the minus sign.
"""

import math
import struct

from companion.core.errors import SensorError
from companion.core.messages import GyroSample
from companion.drivers.chips.sample_clock import SampleClock
from companion.drivers.wires.bus import Bus, Transaction

REG_WHO_AM_I = 0x0F
"""Address of the identity register (DocID025715, section 7)."""
WHO_AM_I = 0x68
"""Identity of accelerometer and gyro (DocID025715, section 7)."""
REG_CTRL_1_G = 0x10
"""Address of CTRL_REG1_G: data rate, full scale and bandwidth of the gyro (DocID025715, section
7)."""
REG_OUT_X_G = 0x18
"""First of the gyro's six output registers, 0x18 to 0x1D (DocID025715, section 7)."""
REG_CTRL_6_XL = 0x20
"""Address of CTRL_REG6_XL: data rate of the accelerometer (DocID025715, section 7)."""
REG_CTRL_8 = 0x22
"""Address of CTRL_REG8: block update and address increment (DocID025715, section 7)."""
REG_CTRL_9 = 0x23
"""Address of CTRL_REG9, which enables the FIFO (DocID025715, section 7)."""
REG_FIFO_CTRL = 0x2E
"""Address of FIFO_CTRL: mode of the FIFO (DocID025715, section 7)."""
REG_FIFO_SRC = 0x2F
"""Address of FIFO_SRC: state of the FIFO (DocID025715, section 7)."""

ODR_119_HZ_245_DPS = 0x60
"""CTRL_REG1_G: data rate 119 Hz in bits 7 to 5, full scale 245 °/s in bits 4 and 3 (DocID025715,
section 7)."""
ACCELEROMETER_OFF = 0x00
"""CTRL_REG6_XL: accelerometer powered down (DocID025715, section 7)."""
BLOCK_UPDATE_AND_AUTO_INCREMENT = 0x44
"""CTRL_REG8: bits BDU, 0x40, and IF_ADD_INC, 0x04 (DocID025715, section 7)."""
FIFO_ENABLE = 0x02
"""CTRL_REG9: bit FIFO_EN (DocID025715, section 7)."""
FIFO_CONTINUOUS = 0xC0
"""FIFO_CTRL: mode in bits 7 to 5; new samples replace the oldest (DocID025715, section 3.5.3)."""
FIFO_COUNT_BITS = 0x3F
"""FIFO_SRC: bits 5 to 0, the number of samples in the FIFO (DocID025715, section 7)."""
FIFO_OVERRUN = 0x40
"""FIFO_SRC: bit 6, set if samples were lost (DocID025715, section 7)."""
RAD_S_PER_COUNT = math.radians(8.75e-3)
"""Sensitivity, rad/s per count: 8.75 mdps at 245 °/s (DocID025715, mechanical characteristics)."""
SAMPLE = struct.Struct("<hhh")
"""OUT_X_G to OUT_Z_G. With the FIFO enabled, the read address wraps from the last of these
registers to the first, to the next sample of the FIFO."""
NOMINAL_ODR_HZ = 119.0
"""Nominal output data rate, Hz (DocID025715, section 7)."""
SILENT_S = 0.1
"""An empty FIFO for this time means that the chip lost its supply and its configuration, s.
Chosen."""


class Lsm9ds1:
    """The gyro of an LSM9DS1.

    Raises:
        SensorError: no LSM9DS1 answers at the address.
    """

    def __init__(self, bus: Bus, address: int) -> None:
        self._bus = bus
        self._address = address
        self._read_level = Transaction(address, bytes([REG_FIFO_SRC]), 1)
        self._clock: SampleClock | None = None
        self._received_s = -math.inf
        self._configured = False
        try:
            found = bus.transfer([Transaction(address, bytes([REG_WHO_AM_I]), 1)])[0][0]
            if found == WHO_AM_I:  # nothing is written to another chip
                self._configure()
        except SensorError:
            raise
        except OSError as error:
            raise SensorError(
                f"no LSM9DS1 at 0x{address:02x} ({error}); check wiring and its SDO_AG pin"
            ) from error
        if found != WHO_AM_I:
            raise SensorError(
                f"the chip at 0x{address:02x} is no LSM9DS1 (WHO_AM_I is 0x{found:02x}, not 0x68); "
                "check sensors.gyro_address"
            )

    def _configure(self) -> None:
        settings = (
            (REG_CTRL_8, BLOCK_UPDATE_AND_AUTO_INCREMENT),
            (REG_CTRL_6_XL, ACCELEROMETER_OFF),
            (REG_CTRL_1_G, ODR_119_HZ_245_DPS),
            (REG_CTRL_9, FIFO_ENABLE),
            (REG_FIFO_CTRL, FIFO_CONTINUOUS),
        )
        self._bus.transfer([Transaction(self._address, bytes(setting)) for setting in settings])
        self._configured = True

    def read(self, time_s: float) -> list[GyroSample]:
        """All samples since the last read, with their times; [] on a fault."""
        try:
            if not self._configured:
                self._configure()
            counts, is_whole = self._drain()
        except OSError:
            self._configured = False  # it may have been power-cycled
            self._clock = None
            return []
        if counts or self._clock is None:
            self._received_s = time_s
        elif time_s - self._received_s > SILENT_S:
            self._configured, self._clock = False, None
            return []
        if not is_whole:  # samples were lost; these are the latest ones
            first_s = time_s - len(counts) / NOMINAL_ODR_HZ
            last_s = self._clock.newest_s if self._clock else first_s
            self._clock = SampleClock(max(first_s, last_s), NOMINAL_ODR_HZ)
        if self._clock is None:  # the age of the samples in the FIFO is unknown
            self._clock = SampleClock(time_s, NOMINAL_ODR_HZ)
            return []
        if not counts:
            return []
        times_s = self._clock.stamp(time_s, len(counts))
        return [
            GyroSample(sample_s, -count * RAD_S_PER_COUNT)
            for sample_s, count in zip(times_s, counts, strict=True)
        ]

    def _drain(self) -> tuple[list[int], bool]:
        """The z axis of all samples in the FIFO, in one burst, and True if no sample was lost."""
        ((source,),) = self._bus.transfer([self._read_level])
        count = source & FIFO_COUNT_BITS
        is_whole = not source & FIFO_OVERRUN
        if not count:
            return [], is_whole
        burst = Transaction(self._address, bytes([REG_OUT_X_G]), count * SAMPLE.size)
        (answer,) = self._bus.transfer([burst])
        return [z for _, _, z in SAMPLE.iter_unpack(answer)], is_whole

"""STMicroelectronics LSM9DS1: its gyro, through the chip's FIFO so that no sample is lost.

Registers as in the datasheet (DocID025715), section 7. Mounted with the chip's z axis up, its
positive rate is counter-clockwise seen from above; FRD yaw is clockwise, hence the minus sign.
"""

import math
import struct

from companion.drivers.bus import Bus, Transaction
from companion.errors import SensorError
from companion.messages import GyroSample

REG_WHO_AM_I = 0x0F
WHO_AM_I = 0x68
REG_CTRL_1_G = 0x10
REG_OUT_X_G = 0x18
REG_CTRL_6_XL = 0x20
REG_CTRL_8 = 0x22
REG_CTRL_9 = 0x23
REG_FIFO_CTRL = 0x2E
REG_FIFO_SRC = 0x2F

ODR_119_HZ_245_DPS = 0x60
ACCELEROMETER_OFF = 0x00
BLOCK_UPDATE_AND_AUTO_INCREMENT = 0x44
FIFO_ENABLE = 0x02
FIFO_CONTINUOUS = 0xC0
FIFO_COUNT_BITS = 0x3F
FIFO_OVERRUN = 0x40
RAD_S_PER_COUNT = math.radians(8.75e-3)
SAMPLE = struct.Struct("<hhh")
"""OUT_X_G to OUT_Z_G. While the FIFO is on, the address that is read next goes back from the last
of these registers to the first, to the FIFO's next sample."""
NOMINAL_ODR_HZ = 119.0
LEAST_TO_TELL_PERIOD = 119


class SampleClock:
    """When the chip took its samples, by our clock.

    The chip's period is known to some percent, and when it began is not known at all. But the
    newest sample in the FIFO is never in the future nor older than a period: each read narrows
    down where the samples lie, and the number of all samples tells the period.
    """

    def __init__(self, time_s: float) -> None:
        self._began_s = self._newest_s = time_s
        self._period_s = 1 / NOMINAL_ODR_HZ
        self._count = 0

    def stamp(self, time_s: float, count: int) -> list[float]:
        """The times of the `count` samples that were waiting at `time_s`."""
        self._count += count
        if self._count >= LEAST_TO_TELL_PERIOD:
            self._period_s = (time_s - self._began_s) / self._count
        newest_s = self._newest_s + count * self._period_s
        newest_s = min(max(newest_s, time_s - self._period_s), time_s)
        step_s = (newest_s - self._newest_s) / count
        times_s = [self._newest_s + i * step_s for i in range(1, count + 1)]
        self._newest_s = newest_s
        return times_s


class Lsm9ds1:
    """The gyro.

    Raises:
        SensorError: no LSM9DS1 answers at the address.
    """

    def __init__(self, bus: Bus, address: int) -> None:
        self._bus = bus
        self._address = address
        self._ask_level = Transaction(address, bytes([REG_FIFO_SRC]), 1)
        self._clock: SampleClock | None = None
        self._configured = False
        try:
            found = bus.transfer([Transaction(address, bytes([REG_WHO_AM_I]), 1)])[0][0]
            self._configure()
        except SensorError:
            raise
        except OSError as error:
            raise SensorError(
                f"no LSM9DS1 at 0x{address:02x} ({error}); check wiring and its SDO_AG pin"
            ) from error
        if found != WHO_AM_I:
            raise SensorError(
                f"the chip at 0x{address:02x} is no LSM9DS1 (it says 0x{found:02x}, not 0x68); "
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
        """All samples since the last read, as they were taken; [] on a fault."""
        try:
            if not self._configured:
                self._configure()
            counts, is_whole = self._drain()
        except OSError:
            self._configured = False  # it may come back freshly powered
            self._clock = None
            return []
        if not is_whole:  # those before were lost, these are the latest
            self._clock = SampleClock(time_s - len(counts) / NOMINAL_ODR_HZ)
        if self._clock is None:  # what had been waiting is of unknown age
            self._clock = SampleClock(time_s)
            return []
        if not counts:
            return []
        times_s = self._clock.stamp(time_s, len(counts))
        return [
            GyroSample(sample_s, -count * RAD_S_PER_COUNT)
            for sample_s, count in zip(times_s, counts, strict=True)
        ]

    def _drain(self) -> tuple[list[int], bool]:
        """The z axis of all that the FIFO holds, in one burst, and whether nothing was lost."""
        ((source,),) = self._bus.transfer([self._ask_level])
        count = source & FIFO_COUNT_BITS
        is_whole = not source & FIFO_OVERRUN
        if not count:
            return [], is_whole
        burst = Transaction(self._address, bytes([REG_OUT_X_G]), count * SAMPLE.size)
        (answer,) = self._bus.transfer([burst])
        return [z for _, _, z in SAMPLE.iter_unpack(answer)], is_whole

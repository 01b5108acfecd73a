"""Emulates the LSM9DS1's gyro at its bus, with its error sources.

Registers, bits and sensitivities are those of the datasheet (DocID025715), not of the companion's
driver. The datasheet has no figures for drift. `GyroNoise` is the reference noise; `Warming`
adds a little to it.
"""

import math
import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from random import Random

REG_WHO_AM_I, WHO_AM_I = 0x0F, 0x68
"""Address and value of the identity (DocID025715, section 7)."""
REG_CTRL_1_G = 0x10
"""Output data rate, full scale and bandwidth of the gyro (DocID025715, section 7)."""
ODR_SHIFT, ODR_119_HZ = 5, 0b011
"""Output data rate, bits 7 to 5 of CTRL_REG1_G; the only rate emulated (DocID025715, section 7)."""
NOMINAL_ODR_HZ = 119.0
"""Nominal output data rate, Hz (DocID025715, section 7)."""
FS_SHIFT, FS_BITS = 3, 0b11
"""Full scale, bits 4 and 3 of CTRL_REG1_G (DocID025715, section 7)."""
MDPS_PER_COUNT = {0b00: 8.75, 0b01: 17.5, 0b11: 70.0}
"""Sensitivity by full scale, mdps per count: of 245, 500 and 2000 °/s (DocID025715, mechanical
characteristics)."""
MAX_COUNT = 32767
"""Largest count: 16 bits, two's complement. At 8.75 mdps it is 286.7 °/s."""
REG_OUT_TEMP = 0x15
"""First register of the temperature output: little-endian, two's complement."""
TEMP_BYTES = 2
"""Size of the temperature output, bytes."""
COUNTS_PER_DEG_C = 16
"""Sensitivity of the temperature output, counts per °C (DocID025715). Some drivers use 8."""
ZERO_COUNT_DEG_C = 25.0
"""Temperature at which the output is 0, °C."""
REG_OUT_X_G = 0x18
"""First of the six output registers of the gyro, 0x18 to 0x1D (DocID025715, section 7)."""
AXES = struct.Struct("<hhh")
"""x, y and z of one sample, each low byte first (DocID025715, section 7)."""
REG_CTRL_9, FIFO_EN = 0x23, 0x02
"""Address of CTRL_REG9 and its bit that enables the FIFO (DocID025715, section 7)."""
REG_FIFO_CTRL = 0x2E
"""Mode of the FIFO (DocID025715, section 7)."""
FMODE_SHIFT, FMODE_CONTINUOUS = 5, 0b110
"""FIFO mode, bits 7 to 5 of FIFO_CTRL: new samples replace the oldest (DocID025715, section 3.5.3).
The only mode emulated."""
REG_FIFO_SRC, OVERRUN = 0x2F, 0x40
"""State of the FIFO: the samples in it, bits 5 to 0, and the bit for lost ones (DocID025715,
section 7)."""
FIFO_DEPTH = 32
"""Samples in the FIFO (DocID025715, section 3.5)."""
WALK_SAMPLES = 10
"""Samples between two updates of the bias."""
YawRate = Callable[[float], float]
"""time_s -> true body rate about the down axis, rad/s."""


@dataclass(frozen=True, slots=True)
class GyroNoise:
    """Standard deviations. Those of the reference noise apply after the calibration at rest."""

    turn_on_bias_rad_s: float = math.radians(1.0)
    flight_bias_rad_s: float = math.radians(0.1)
    """Bias added in flight by warming and vibration, with the time constant below, rad/s.

    The bias that the chip gains over minutes of warming is added to it.
    """
    flight_bias_after_s: float = 5.0
    flight_bias_time_constant_s: float = 8.0
    bias_walk_rad_s_sqrt_s: float = math.radians(20 / 3600)
    white_rad_s_sqrt_hz: float = math.radians(0.01)
    scale: float = 0.02
    clock: float = 0.02
    """Relative error of the chip's sample clock."""


@dataclass(frozen=True, slots=True)
class Warming:
    """Temperature of the chip since power-on at time 0, and the bias that follows it.

    A prior from memory of such chips: neither slope nor rise has been measured.
    """

    bias_rad_s_deg_c: float
    room_deg_c: float = 22.0
    rise_deg_c: float = 4.0
    time_constant_s: float = 240.0

    def temperature_deg_c(self, time_s: float) -> float:
        return self.room_deg_c + self._risen_deg_c(time_s)

    def bias_rad_s(self, time_s: float) -> float:
        """Bias gained since power-on, rad/s; the turn-on bias is not included."""
        return self.bias_rad_s_deg_c * self._risen_deg_c(time_s)

    def _risen_deg_c(self, time_s: float) -> float:
        return self.rise_deg_c * (1 - math.exp(-time_s / self.time_constant_s))


def draw_warming(random: Random) -> Warming:
    """Draw one chip: its bias changes by 0.03 to 0.05 deg/s per °C, up or down."""
    return Warming(random.choice((-1, 1)) * math.radians(random.uniform(0.03, 0.05)))


class Lsm9ds1Device:
    """FIFO in continuous mode, gyro only; x and y axes read zero."""

    def __init__(
        self,
        yaw_rate: YawRate,
        random: Random,
        warming: Warming,
        noise: GyroNoise = GyroNoise(),
    ) -> None:
        self._yaw_rate = yaw_rate
        self._random = random
        self._warming = warming
        self._noise = noise
        self._turn_on_bias = random.gauss(0, noise.turn_on_bias_rad_s)
        self._flight_bias = random.gauss(0, noise.flight_bias_rad_s)
        self._scale = 1 + random.gauss(0, noise.scale)
        self._period_s = 1 / (NOMINAL_ODR_HZ * (1 + random.gauss(0, noise.clock)))
        self._walk = 0.0
        self._bias = self._turn_on_bias
        self._walk_kick = noise.bias_walk_rad_s_sqrt_s * math.sqrt(WALK_SAMPLES * self._period_s)
        self._white = noise.white_rad_s_sqrt_hz / math.sqrt(2 * self._period_s)
        self.fault_bias_rad_s = 0.0
        self.is_saturated = False
        """Faults for tests: an added bias, and readings at full scale."""
        self._sampled = 0
        self._fifo: deque[bytes] = deque(maxlen=FIFO_DEPTH)
        """Samples in the order in which they are read, each with x, y and z."""
        self.power_cycle()

    def power_cycle(self) -> None:
        """A fault for tests: a short interruption of the supply voltage."""
        self._fifo.clear()
        self._overrun = False
        self._registers = bytearray(128)
        self._registers[REG_WHO_AM_I] = WHO_AM_I

    def write_read(self, data: bytes, count: int, time_s: float) -> bytes:
        self._fill(time_s)
        register = data[0] & 0x7F if data else 0
        for offset, value in enumerate(data[1:]):
            address = (register + offset) & 0x7F
            if address != REG_WHO_AM_I:
                self._registers[address] = value
        if not count:
            return b""
        if register == REG_FIFO_SRC:
            self._registers[REG_FIFO_SRC] = len(self._fifo) | (OVERRUN if self._overrun else 0)
            self._overrun = False
        elif register == REG_OUT_X_G:
            return self._samples(count)
        elif register <= REG_OUT_TEMP + 1:
            self._measure_temperature(time_s)
        end = register + count
        return bytes(self._registers[register:end]).ljust(count, b"\x00")

    def _samples(self, count: int) -> bytes:
        """Oldest sample first. After OUT_Z_H_G the address wraps to OUT_X_L_G: the next sample."""
        samples = min(-(-count // AXES.size), len(self._fifo))
        read = b"".join([self._fifo.popleft() for _ in range(samples)])
        return read[:count].ljust(count, b"\x00")

    def _measure_temperature(self, time_s: float) -> None:
        above_deg_c = self._warming.temperature_deg_c(time_s) - ZERO_COUNT_DEG_C
        counts = round(above_deg_c * COUNTS_PER_DEG_C)
        self._registers[REG_OUT_TEMP : REG_OUT_TEMP + TEMP_BYTES] = counts.to_bytes(
            TEMP_BYTES, "little", signed=True
        )

    @property
    def _is_sampling(self) -> bool:
        """True if the gyro runs at the emulated rate into the FIFO, in the emulated mode."""
        return (
            self._registers[REG_CTRL_1_G] >> ODR_SHIFT == ODR_119_HZ
            and self._full_scale in MDPS_PER_COUNT
            and bool(self._registers[REG_CTRL_9] & FIFO_EN)
            and self._registers[REG_FIFO_CTRL] >> FMODE_SHIFT == FMODE_CONTINUOUS
        )

    @property
    def _full_scale(self) -> int:
        return self._registers[REG_CTRL_1_G] >> FS_SHIFT & FS_BITS

    def _fill(self, time_s: float) -> None:
        """Sample at the chip's clock until `time_s`; samples beyond the FIFO's depth are lost."""
        due = int(time_s / self._period_s)
        if not self._is_sampling:
            self._sampled = due
            return
        if due - self._sampled > FIFO_DEPTH:
            self._sampled = due - FIFO_DEPTH
            self._overrun = True
        while self._sampled < due:
            self._sampled += 1
            self._fifo.append(self._sample(self._sampled * self._period_s))

    def _sample(self, time_s: float) -> bytes:
        if self._sampled % WALK_SAMPLES == 0:
            self._drift(time_s)
        rate = self._yaw_rate(time_s) * self._scale + self._bias
        rate += self._random.gauss(0, self._white) + self.fault_bias_rad_s
        rad_s_per_count = math.radians(MDPS_PER_COUNT[self._full_scale] * 1e-3)
        if self.is_saturated:
            rate = math.copysign(MAX_COUNT * rad_s_per_count, rate)
        # The chip's z axis points up: its positive rate is counter-clockwise.
        counts = round(-rate / rad_s_per_count)
        return AXES.pack(0, 0, max(-MAX_COUNT - 1, min(MAX_COUNT, counts)))

    def _drift(self, time_s: float) -> None:
        """Update the bias. It changes too slowly to compute it for every sample."""
        noise = self._noise
        self._walk += self._random.gauss(0, self._walk_kick)
        warm_s = max(time_s - noise.flight_bias_after_s, 0.0)
        warm = 1 - math.exp(-warm_s / noise.flight_bias_time_constant_s)
        gained = self._flight_bias * warm + self._warming.bias_rad_s(time_s)
        self._bias = self._turn_on_bias + gained + self._walk

"""Texas Instruments ADS1115: four single-ended 16-bit channels over I2C.

Registers and bits as in the datasheet (SBAS444), table 8 and figure 36.
"""

from collections.abc import Sequence

from companion.drivers.bus import Bus
from companion.errors import SensorError

REG_CONVERSION, REG_CONFIG = 0x00, 0x01
START = 0x8000
"""OS bit: written, starts a conversion; read, says that none is running."""
MUX_SINGLE_ENDED = 0x4000
MUX_STEP = 0x1000
PGA_4_096_V = 0x0200
SINGLE_SHOT = 0x0100
RATE_860_SPS = 0x00E0
COMPARATOR_OFF = 0x0003
CONVERSION_S = 1 / 860 * 1.1
"""The chip's own clock may be 10 % slow."""
VOLTS_PER_COUNT = 4.096 / 32768
READ_BACK_BITS = 0x7FFF


def config_word(channel: int) -> int:
    """Start one conversion of AINn against ground at ±4.096 V, 860 samples a second."""
    mux = MUX_SINGLE_ENDED + channel * MUX_STEP
    return START | mux | PGA_4_096_V | SINGLE_SHOT | RATE_860_SPS | COMPARATOR_OFF


class Ads1115:
    """One chip. Start a channel, let the bus wait `CONVERSION_S`, then read it.

    Raises:
        SensorError: no ADS1115 answers at the address.
    """

    def __init__(self, bus: Bus, address: int) -> None:
        self._bus = bus
        self.address = address
        try:
            self.start(0)
            answer = bus.write_read(address, bytes([REG_CONFIG]), 2)
        except OSError as error:
            raise SensorError(
                f"no ADS1115 at 0x{address:02x} ({error}); check wiring and its ADDR pin"
            ) from error
        found = int.from_bytes(answer, "big") & READ_BACK_BITS
        if found != config_word(0) & READ_BACK_BITS:
            raise SensorError(
                f"the chip at 0x{address:02x} is no ADS1115 (its config reads 0x{found:04x}); "
                "check the addresses in [sensors]"
            )

    def start(self, channel: int) -> None:
        word = config_word(channel)
        self._bus.write_read(self.address, bytes([REG_CONFIG, word >> 8, word & 0xFF]), 0)

    def read_volts(self) -> float:
        """The latest finished conversion."""
        answer = self._bus.write_read(self.address, bytes([REG_CONVERSION]), 2)
        return int.from_bytes(answer, "big", signed=True) * VOLTS_PER_COUNT


def rounds(channels: Sequence[tuple[int, int]]) -> list[list[tuple[int, int]]]:
    """Order (address, channel) pairs so that in each round every chip converts one channel."""
    waiting = list(channels)
    ordered: list[list[tuple[int, int]]] = []
    while waiting:
        now: dict[int, tuple[int, int]] = {}
        for pair in waiting:
            now.setdefault(pair[0], pair)
        ordered.append(list(now.values()))
        waiting = [pair for pair in waiting if pair not in ordered[-1]]
    return ordered

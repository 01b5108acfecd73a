"""Texas Instruments ADS1115: four single-ended 16-bit channels, one conversion at a time.

Registers and bits as in the datasheet (SBAS444), table 8 and figure 36.
"""

from collections.abc import Sequence

from companion.drivers.bus import Bus, Transaction
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


def start(address: int, channel: int) -> Transaction:
    """Start a conversion; its result can be read `CONVERSION_S` later."""
    return Transaction(address, bytes([REG_CONFIG]) + config_word(channel).to_bytes(2, "big"))


def read(address: int) -> Transaction:
    """Read the latest finished conversion."""
    return Transaction(address, bytes([REG_CONVERSION]), 2)


def volts(answer: bytes) -> float:
    """What the answer to `read` says."""
    return int.from_bytes(answer, "big", signed=True) * VOLTS_PER_COUNT


def check(bus: Bus, address: int) -> None:
    """Make sure that an ADS1115 is there: it has no identity, but keeps what it is told.

    Raises:
        SensorError: names the address and the remedy.
    """
    try:
        read_back = Transaction(address, bytes([REG_CONFIG]), 2)
        _, answer = bus.transfer([start(address, 0), read_back])
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

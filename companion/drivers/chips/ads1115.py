"""Texas Instruments ADS1115: four single-ended 16-bit channels, one conversion at a time.

Registers and bits: datasheet SBAS444, table 8 and figure 36.
"""

from collections.abc import Sequence

from companion.core.errors import SensorError
from companion.drivers.wires.bus import Bus, Transaction

REG_CONVERSION, REG_CONFIG = 0x00, 0x01
"""Addresses of the conversion and config registers (SBAS444, pointer register)."""
START = 0x8000
"""OS bit. Written: starts a conversion. Read: no conversion is running."""
MUX_SINGLE_ENDED = 0x4000
"""Input multiplexer, bits 14 to 12 of the config register: AIN0 against ground (SBAS444)."""
MUX_STEP = 0x1000
"""Difference of the multiplexer bits between one single-ended input and the next (SBAS444)."""
PGA_4_096_V = 0x0200
"""Gain amplifier, bits 11 to 9 of the config register: full scale ±4.096 V (SBAS444)."""
SINGLE_SHOT = 0x0100
"""Mode bit 8 of the config register: one conversion a request (SBAS444)."""
RATE_860_SPS = 0x00E0
"""Data rate, bits 7 to 5 of the config register: 860 samples per second (SBAS444)."""
COMPARATOR_OFF = 0x0003
"""Comparator queue, bits 1 and 0 of the config register: disabled (SBAS444)."""
CONVERSION_S = 1 / 860 * 1.1
"""Duration of a conversion, s: 860 samples per second; the chip's clock may be 10 % slow."""
VOLTS_PER_COUNT = 4.096 / 32768
"""Resolution, V per count: 16 bits, two's complement, at ±4.096 V (SBAS444)."""
READ_BACK_BITS = 0x7FFF
"""Bits of the config register that read as they were written: all but OS (SBAS444)."""
Channel = tuple[int, int]
"""I2C address of the chip, and its input."""


def config_word(channel: int) -> int:
    """Start one conversion of AINn against ground at ±4.096 V, 860 samples per second."""
    mux = MUX_SINGLE_ENDED + channel * MUX_STEP
    return START | mux | PGA_4_096_V | SINGLE_SHOT | RATE_860_SPS | COMPARATOR_OFF


def start(address: int, channel: int, wait_s: float = 0.0) -> Transaction:
    """Start a conversion; its result can be read `CONVERSION_S` later."""
    data = bytes([REG_CONFIG]) + config_word(channel).to_bytes(2, "big")
    return Transaction(address, data, wait_s=wait_s)


def read(address: int) -> Transaction:
    """Read the latest finished conversion."""
    return Transaction(address, bytes([REG_CONVERSION]), 2)


def volts(answer: bytes) -> float:
    """Voltage of the answer to `read`, V."""
    return int.from_bytes(answer, "big", signed=True) * VOLTS_PER_COUNT


def check(bus: Bus, address: int) -> None:
    """Check that an ADS1115 is there. It has no identity, but stores its configuration.

    Raises:
        SensorError: names the address and the remedy.
    """
    try:
        read_back = Transaction(address, bytes([REG_CONFIG]), 2)
        _, answer = bus.transfer([start(address, 0), read_back])
    except SensorError:
        raise
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


class ConversionSweep:
    """One conversion of every channel in one transfer. All chips convert at the same time."""

    def __init__(self, channels: Sequence[Channel]) -> None:
        self._transactions: list[Transaction] = []
        self._read_at: dict[Channel, int] = {}
        """Index of the transaction that reads a channel."""
        for round_ in rounds(channels):
            *others, last = round_
            self._transactions += [start(*channel) for channel in others]
            self._transactions.append(start(*last, wait_s=CONVERSION_S))
            for channel in round_:
                self._read_at[channel] = len(self._transactions)
                self._transactions.append(read(channel[0]))

    def volts(self, bus: Bus) -> dict[Channel, float]:
        """Voltage of each input.

        Raises:
            OSError: a chip does not answer.
        """
        answers = bus.transfer(self._transactions)
        return {channel: volts(answers[at]) for channel, at in self._read_at.items()}


def rounds(channels: Sequence[Channel]) -> list[list[Channel]]:
    """Order channels so that in each round every chip converts one."""
    pending = list(channels)
    ordered: list[list[Channel]] = []
    while pending:
        now: dict[int, Channel] = {}
        for channel in pending:
            now.setdefault(channel[0], channel)
        ordered.append(list(now.values()))
        pending = [channel for channel in pending if channel not in ordered[-1]]
    return ordered

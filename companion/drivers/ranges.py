"""All range sensors in one sweep."""

from companion.config import SensorsConfig
from companion.drivers import ads1115
from companion.drivers.bus import Bus
from companion.drivers.sharp import PROFILES
from companion.messages import RangeReading, RangeScan, RangeState

Channel = tuple[int, int]
"""I2C address of the ADC, and its input."""
STALE_FOR_S = 0.25
"""A sensor that was well this recently is called stale; after that it has failed."""


class RangeSensors:
    """Sharp sensors on ADS1115 chips.

    Raises:
        SensorError: a chip is missing or is not what it should be, at the start only; later
            faults are states of the readings.
    """

    def __init__(self, bus: Bus, config: SensorsConfig) -> None:
        self._bus = bus
        self._profile = PROFILES[config.profile]
        self._beams = {(c.address, c.channel): beam for beam, c in config.channels.items()}
        self._rounds = ads1115.rounds(list(self._beams))
        self._good_s = dict.fromkeys(self._beams, float("-inf"))
        for address in sorted({address for address, _ in self._beams}):
            ads1115.check(bus, address)

    def read(self, time_s: float) -> RangeScan:
        """One sweep, all chips converting at the same time."""
        volts = self._sweep(self._rounds)
        if len(volts) < len(self._beams):  # a chip is gone: the others are read one by one
            volts = {}
            for address in {address for address, _ in self._beams}:
                mine = [[p for p in pairs if p[0] == address] for pairs in self._rounds]
                volts |= self._sweep([pairs for pairs in mine if pairs])
        readings = {}
        for pair, beam in self._beams.items():
            if pair in volts:
                self._good_s[pair] = time_s
                readings[beam] = self._profile.reading(volts[pair])
            else:
                stale = time_s - self._good_s[pair] <= STALE_FOR_S
                readings[beam] = RangeReading(RangeState.STALE if stale else RangeState.FAILED)
        return RangeScan(time_s, readings)

    def _sweep(self, rounds: list[list[Channel]]) -> dict[Channel, float]:
        """Volts by channel: each round is started by the transfer that reads the one before."""
        volts: dict[Channel, float] = {}
        try:
            for before, pairs in zip([[], *rounds], [*rounds, []], strict=True):
                reads = [ads1115.read(address) for address, _ in before]
                answers = self._bus.transfer(reads + [ads1115.start(*pair) for pair in pairs])
                volts |= dict(zip(before, map(ads1115.volts, answers), strict=False))
                if pairs:
                    self._bus.wait(ads1115.CONVERSION_S)
        except OSError:
            return {}
        return volts

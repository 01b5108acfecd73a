"""All range sensors in one sweep."""

from companion.config import SensorsConfig
from companion.drivers.ads1115 import CONVERSION_S, Ads1115, rounds
from companion.drivers.bus import Bus
from companion.drivers.sharp import PROFILES
from companion.messages import RangeReading, RangeScan, RangeState

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
        self._chips = {a: Ads1115(bus, a) for a in sorted({a for a, _ in self._beams})}
        self._rounds = rounds(list(self._beams))
        self._good_s = dict.fromkeys(self._beams, float("-inf"))

    def read(self, time_s: float) -> RangeScan:
        """One sweep, all chips converting at the same time."""
        volts: dict[tuple[int, int], float] = {}
        for pairs in self._rounds:
            volts |= self._convert(pairs)
        readings = {}
        for pair, beam in self._beams.items():
            if pair in volts:
                self._good_s[pair] = time_s
                readings[beam] = self._profile.reading(volts[pair])
            else:
                stale = time_s - self._good_s[pair] <= STALE_FOR_S
                readings[beam] = RangeReading(RangeState.STALE if stale else RangeState.FAILED)
        return RangeScan(time_s, readings)

    def _convert(self, pairs: list[tuple[int, int]]) -> dict[tuple[int, int], float]:
        """Volts of one channel on each chip; chips that do not answer are left out."""
        started = []
        for pair in pairs:
            try:
                self._chips[pair[0]].start(pair[1])
                started.append(pair)
            except OSError:
                continue
        volts: dict[tuple[int, int], float] = {}
        try:
            self._bus.wait(CONVERSION_S)
        except OSError:
            return volts
        for pair in started:
            try:
                volts[pair] = self._chips[pair[0]].read_volts()
            except OSError:
                continue
        return volts

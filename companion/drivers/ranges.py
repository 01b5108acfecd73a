"""All range sensors in one sweep."""

from companion.config import SensorsConfig
from companion.drivers import ads1115
from companion.drivers.ads1115 import Channel, Sweep
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
        self._good_s = dict.fromkeys(self._beams, float("-inf"))
        self._sweep = Sweep(list(self._beams))
        addresses = sorted({address for address, _ in self._beams})
        self._sweeps_alone = [Sweep([c for c in self._beams if c[0] == a]) for a in addresses]
        """Of each chip by itself."""
        for address in addresses:
            ads1115.check(bus, address)

    def read(self, time_s: float) -> RangeScan:
        """One sweep, all chips converting at the same time."""
        volts = self._volts(self._sweep)
        if not volts:  # a chip is gone: the others are read one by one
            for sweep in self._sweeps_alone:
                volts |= self._volts(sweep)
        readings = {}
        for channel, beam in self._beams.items():
            if channel in volts:
                self._good_s[channel] = time_s
                readings[beam] = self._profile.reading(volts[channel])
            else:
                stale = time_s - self._good_s[channel] <= STALE_FOR_S
                readings[beam] = RangeReading(RangeState.STALE if stale else RangeState.FAILED)
        return RangeScan(time_s, readings)

    def _volts(self, sweep: Sweep) -> dict[Channel, float]:
        try:
            return sweep.volts(self._bus)
        except OSError:
            return {}

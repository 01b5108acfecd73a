"""An ADC's inputs, and what stands at one with nothing on it.

Nothing pulls such an input anywhere: it stands at some tenths of a volt, with little noise, drawn
towards what the chip has converted just before, whose charge is left on the capacitor that samples
all its inputs.
"""

from collections.abc import Mapping
from random import Random

from sitl.sensors.sharp import SharpUnit

MIN_LEVEL_V, MAX_LEVEL_V = 0.2, 0.7
"""Reported of open ADS1115 inputs: 0.57 V and the like."""
NOISE_V = 0.003


class AdcInputs:
    """Of one chip; `volts` is what it converts."""

    def __init__(self, units: Mapping[int, SharpUnit], random: Random) -> None:
        self._units = units
        self._random = random
        self._level_v = random.uniform(MIN_LEVEL_V, MAX_LEVEL_V)
        self._before_v = self._level_v
        for unit in units.values():
            unit.open_input_v = self._open_v

    def volts(self, channel: int, time_s: float) -> float:
        unit = self._units.get(channel)
        self._before_v = unit.volts(time_s) if unit else self._open_v(0.0)
        return self._before_v

    def _open_v(self, memory: float) -> float:
        """`memory` is the share that is left of the conversion before."""
        kept_v = memory * (self._before_v - self._level_v)
        return self._level_v + kept_v + self._random.gauss(0, NOISE_V)

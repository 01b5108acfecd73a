"""Models an ADC's inputs, also open ones.

An open input floats at some tenths of a volt with little noise. It is drawn towards the chip's
previous conversion, because one capacitor samples all inputs and keeps part of its charge.
"""

from collections.abc import Mapping
from random import Random

from sitl.sensors.sharp import SharpUnit

MIN_LEVEL_V, MAX_LEVEL_V = 0.2, 0.7
"""Range of an open ADS1115 input, V. Reported: 0.57 V and similar values."""
NOISE_V = 0.003
"""Standard deviation of an open input's voltage, V. Chosen."""


class AdcInputs:
    """Inputs of one chip; `volts` is the voltage that the chip converts."""

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
        """Voltage of an open input, V; `memory` is the share kept of the previous conversion."""
        kept_v = memory * (self._before_v - self._level_v)
        return self._level_v + kept_v + self._random.gauss(0, NOISE_V)

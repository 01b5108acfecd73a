"""Groups of range sensors that are read together: of one bus, of one chip, or a single one."""

from collections.abc import Mapping
from typing import Protocol

from companion.config.range_sensors import SharpOnAds1115, SharpOnMcp3008
from companion.core.messages import Beam, RangeReading
from companion.drivers.chips import ads1115
from companion.drivers.chips.ads1115 import Channel, ConversionSweep
from companion.drivers.chips.mcp3008 import Mcp3008
from companion.drivers.chips.sharp import PROFILES, Profile
from companion.drivers.wires.bus import Bus, Spi


class Source(Protocol):
    """Some of the drone's range sensors."""

    def read(self, time_s: float) -> dict[Beam, RangeReading]:
        """Readings by beam; a beam without an answer is missing."""
        ...


class RangeDriver(Protocol):
    """Driver of one sensor."""

    def read(self, time_s: float) -> RangeReading | None:
        """The latest reading; None if the sensor is silent."""
        ...


class SingleSensor:
    """A sensor with its own driver."""

    def __init__(self, beam: Beam, driver: RangeDriver) -> None:
        self._beam = beam
        self._driver = driver

    def read(self, time_s: float) -> dict[Beam, RangeReading]:
        reading = self._driver.read(time_s)
        return {} if reading is None else {self._beam: reading}


class SharpsOnAds1115:
    """Sharp sensors on the ADS1115 of one bus. All chips convert at the same time.

    Raises:
        SensorError: a chip is missing, or is not an ADS1115.
    """

    def __init__(self, bus: Bus, sensors: Mapping[Beam, SharpOnAds1115]) -> None:
        self._bus = bus
        self._beams = {(s.address, s.channel): beam for beam, s in sensors.items()}
        self._profiles = {(s.address, s.channel): PROFILES[s.curve] for s in sensors.values()}
        self._sweep = ConversionSweep(list(self._beams))
        addresses = sorted({address for address, _ in self._beams})
        self._sweeps_alone = [
            ConversionSweep([c for c in self._beams if c[0] == a]) for a in addresses
        ]
        """One sweep per chip."""
        for address in addresses:
            ads1115.check(bus, address)

    def read(self, time_s: float) -> dict[Beam, RangeReading]:
        volts = self._volts(self._sweep)
        if not volts:  # a chip is missing: read the others one by one
            for sweep in self._sweeps_alone:
                volts |= self._volts(sweep)
        return {
            self._beams[channel]: sharp_reading(self._profiles[channel], v)
            for channel, v in volts.items()
        }

    def _volts(self, sweep: ConversionSweep) -> dict[Channel, float]:
        try:
            return sweep.volts(self._bus)
        except OSError:
            return {}


class SharpsOnMcp3008:
    """Sharp sensors on one MCP3008.

    Raises:
        SensorError: no chip answers.
    """

    def __init__(self, spi: Spi, sensors: Mapping[Beam, SharpOnMcp3008]) -> None:
        self._sensors = sensors
        self._channels = [sensor.channel for sensor in sensors.values()]
        chip = next(iter(sensors.values()))
        self._chip = Mcp3008(spi, chip.device, chip.reference_v)

    def read(self, time_s: float) -> dict[Beam, RangeReading]:
        try:
            volts = self._chip.volts(self._channels)
        except OSError:
            return {}
        return {
            beam: sharp_reading(PROFILES[sensor.curve], volts[sensor.channel])
            for beam, sensor in self._sensors.items()
        }


def sharp_reading(profile: Profile, volts: float) -> RangeReading:
    """Reading of a voltage. It includes a noisy voltage, whose repetition shows a fault."""
    reading = profile.reading(volts)
    if not profile.noise_v:
        return reading
    return RangeReading(reading.state, reading.distance_m, reading.variance_m2, volts)

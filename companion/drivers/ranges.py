"""Reads all range sensors, of any type, in one sweep."""

from collections.abc import Collection, Iterator, Mapping
from typing import TypeVar

from companion.config.range_places import mux_addresses
from companion.config.range_sensors import (
    AutopilotRange,
    Calibration,
    RangeSensor,
    SharpOnAds1115,
    SharpOnMcp3008,
    TfminiSensor,
    Vl53l1xSensor,
)
from companion.config.settings import SensorsConfig
from companion.core.messages import Beam, RangeReading, RangeScan, RangeState
from companion.drivers.autopilot import AutopilotRanges
from companion.drivers.chips.tfmini import Tfmini
from companion.drivers.chips.time_of_flight import SERIAL_KINDS
from companion.drivers.chips.vl53l1x import Vl53l1x
from companion.drivers.sources import SharpsOnAds1115, SharpsOnMcp3008, SingleSensor, Source
from companion.drivers.wires.bus import Wires

STALE_FOR_S = 0.25
"""A silent sensor is STALE for this time after its last reading, s, then FAILED. Chosen."""
Kind = TypeVar("Kind")


class RangeSensors:
    """Sensors of all beams, or of those in `only`.

    Raises:
        SensorError: a chip is missing or has the wrong identity, at the start only. Later faults
    are
            states of the readings.
    """

    def __init__(
        self, wires: Wires, config: SensorsConfig, only: Collection[Beam] | None = None
    ) -> None:
        sensors = {b: s for b, s in config.beams.items() if only is None or b in only}
        self._calibration = config.calibration
        self._good_s = dict.fromkeys(sensors, float("-inf"))
        on_autopilot = _of_kind(sensors, AutopilotRange)
        self.from_autopilot = AutopilotRanges(on_autopilot) if on_autopilot else None
        """Must receive the autopilot's messages; None without such beams."""
        self._sources = list(_wired(wires, sensors, mux_addresses(config.beams.values())))
        if self.from_autopilot:
            self._sources.append(self.from_autopilot)

    def read(self, time_s: float) -> RangeScan:
        """Read all sensors once."""
        answers: dict[Beam, RangeReading] = {}
        for source in self._sources:
            answers |= source.read(time_s)
        readings = {}
        for beam, good_s in self._good_s.items():
            if beam in answers:
                self._good_s[beam] = time_s
                readings[beam] = self._calibrated(beam, answers[beam])
            else:
                stale = time_s - good_s <= STALE_FOR_S
                readings[beam] = RangeReading(RangeState.STALE if stale else RangeState.FAILED)
        return RangeScan(time_s, readings)

    def _calibrated(self, beam: Beam, reading: RangeReading) -> RangeReading:
        calibration = self._calibration.get(beam)
        if calibration is None or not reading.is_distance:
            return reading
        return corrected(reading, calibration)


def corrected(reading: RangeReading, calibration: Calibration) -> RangeReading:
    """A distance corrected by the calibration."""
    return RangeReading(
        RangeState.DISTANCE,
        (reading.distance_m - calibration.offset_m) / calibration.gain,
        reading.variance_m2 / calibration.gain**2,
        reading.raw,
    )


def _of_kind(sensors: Mapping[Beam, RangeSensor], kind: type[Kind]) -> dict[Beam, Kind]:
    return {beam: sensor for beam, sensor in sensors.items() if isinstance(sensor, kind)}


def _wired(
    wires: Wires, sensors: Mapping[Beam, RangeSensor], muxes: Collection[int]
) -> Iterator[Source]:
    """Sources on our own wires; `muxes` are the addresses of all multiplexers on the bus."""
    if on_ads1115 := _of_kind(sensors, SharpOnAds1115):
        yield SharpsOnAds1115(wires, on_ads1115)
    on_mcp3008 = _of_kind(sensors, SharpOnMcp3008)
    for device in sorted({sensor.device for sensor in on_mcp3008.values()}):
        on_device = {beam: sensor for beam, sensor in on_mcp3008.items() if sensor.device == device}
        yield SharpsOnMcp3008(wires, on_device)
    for beam, tof in _of_kind(sensors, Vl53l1xSensor).items():
        mux = None if tof.mux_address is None else (tof.mux_address, tof.mux_channel)
        others = [address for address in muxes if address != tof.mux_address]
        yield SingleSensor(beam, Vl53l1x(wires, tof.address, mux, others))
    for beam, serial in _of_kind(sensors, TfminiSensor).items():
        model = SERIAL_KINDS[serial.kind]
        yield SingleSensor(beam, Tfmini(wires, serial.port, serial.baud, model))

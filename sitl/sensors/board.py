"""Builds the sensor board: every chip and sensor of the drone, on its wires."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import TypeVar

from companion.config.range_sensors import (
    AutopilotRange,
    RangeSensor,
    SharpOnAds1115,
    SharpOnMcp3008,
    TfminiSensor,
    Vl53l1xSensor,
)
from companion.config.settings import SensorsConfig
from companion.core.frames import Vector3
from companion.core.messages import Beam
from sitl.core.noise import stream
from sitl.core.truth import STEP_S, TrueState
from sitl.sensors.ads1115 import Ads1115Device
from sitl.sensors.beam import RangeQuery
from sitl.sensors.i2c import Device, DeviceBus, Multiplexer
from sitl.sensors.inputs import AdcInputs
from sitl.sensors.lsm9ds1 import Lsm9ds1Device, draw_warming
from sitl.sensors.mcp3008 import Mcp3008Device
from sitl.sensors.sharp import PHYSICS, USUAL_MEMORY, SharpPhysics, SharpUnit
from sitl.sensors.tfmini import TfminiDevice
from sitl.sensors.time_of_flight import GAIN_SIGMA, TOF_PHYSICS, TofPhysics, TofUnit
from sitl.sensors.vl53l1x import Vl53l1xDevice

TruthAt = Callable[[float], TrueState]
Unit = SharpUnit | TofUnit
Kind = TypeVar("Kind")
AUTOPILOTS_SENSOR_S = 0.050
"""Measuring period of a rangefinder connected to the autopilot, s. Chosen."""

BEAM_FRD: dict[Beam, Vector3] = {
    Beam.FRONT: (1.0, 0.0, 0.0),
    Beam.RIGHT: (0.0, 1.0, 0.0),
    Beam.BACK: (-1.0, 0.0, 0.0),
    Beam.LEFT: (0.0, -1.0, 0.0),
    Beam.UP: (0.0, 0.0, -1.0),
    Beam.DOWN: (0.0, 0.0, 1.0),
}
"""Axis of each beam in the body frame (FRD), unit vectors."""


class SensorBoard:
    """The configured range sensors with their chips, and the gyro."""

    def __init__(
        self,
        seed: int,
        config: SensorsConfig,
        range_query: Callable[[Beam], RangeQuery],
        truth_at: TruthAt,
        *,
        gain_sigma: float | None = None,
    ) -> None:
        self._sensors: dict[Beam, Unit] = {}
        for beam, sensor in config.beams.items():
            physics = physics_of(sensor)
            if gain_sigma is not None:
                physics = replace(physics, gain_sigma=gain_sigma)
            true_range = _beam_query(
                _axis_frd(beam, sensor),
                config.mount_of_m(beam),
                physics.max_return_m,
                range_query(beam),
                truth_at,
            )
            random = stream(seed, f"range sensor {beam.value}")
            self._sensors[beam] = (
                SharpUnit(physics, true_range, random)
                if isinstance(physics, SharpPhysics)
                else TofUnit(physics, true_range, random)
            )
        self._seed = seed
        devices = dict(self._i2c_devices(config))
        self.adc_addresses = frozenset(devices)
        """I2C addresses of the range sensors' chips."""
        self.gyro_address = config.gyro_address
        devices[config.gyro_address] = self.gyro = Lsm9ds1Device(
            # The rate in a state is that of the step that ended with it.
            lambda time_s: truth_at(time_s + 0.5 * STEP_S).yaw_rate_rad_s,
            stream(seed, "gyro"),
            draw_warming(stream(seed, "gyro temperature")),
        )
        ports = {
            s.port: TfminiDevice(self._tof(beam)) for beam, s in _of_kind(config, TfminiSensor)
        }
        self.bus = DeviceBus(devices, dict(self._spi_devices(config)), ports)
        self.from_autopilot = {
            beam: (self._tof(beam), sensor) for beam, sensor in _of_kind(config, AutopilotRange)
        }

    def unplug(self, beam: str, memory: float = USUAL_MEMORY) -> None:
        """A fault for tests: unplug a range sensor.

        The ADC's open input keeps the share `memory` of the chip's previous conversion.
        """
        unit = self._sensors[Beam(beam)]
        unit.is_unplugged = True
        if isinstance(unit, SharpUnit):
            unit.memory = memory

    def plug_in(self, beam: str) -> None:
        self._sensors[Beam(beam)].is_unplugged = False

    def stick(self, beam: str, *, stuck: bool) -> None:
        """A fault for tests: a range sensor repeats its last measurement."""
        self._sensors[Beam(beam)].is_stuck = stuck

    def set_noise(self, beam: str, factor: float) -> None:
        """A fault for tests: multiply a range sensor's noise by a factor."""
        self._sensors[Beam(beam)].noise_factor = factor

    def swap(self, one: str, other: str) -> None:
        """A fault for tests: two range sensors have swapped directions."""
        first, second = self._sensors[Beam(one)], self._sensors[Beam(other)]
        first.true_range, second.true_range = second.true_range, first.true_range

    def set_gain(self, beam: str, gain: float) -> None:
        """A fault for tests: a range sensor's reading is the distance times `gain`."""
        self._sensors[Beam(beam)].gain = gain

    def _i2c_devices(self, config: SensorsConfig) -> Iterator[tuple[int, Device]]:
        inputs: dict[int, dict[int, Beam]] = {}
        for beam, sharp in _of_kind(config, SharpOnAds1115):
            inputs.setdefault(sharp.address, {})[sharp.channel] = beam
        for address, beams in sorted(inputs.items()):
            yield address, Ads1115Device(self._inputs(beams, f"ADS1115 {address}").volts)
        branches: dict[int, dict[int, dict[int, Device]]] = {}
        for beam, tof in _of_kind(config, Vl53l1xSensor):
            device = Vl53l1xDevice(self._tof(beam))
            if tof.mux_address is None:
                yield tof.address, device
            else:
                mux = branches.setdefault(tof.mux_address, {})
                mux.setdefault(tof.mux_channel, {})[tof.address] = device
        for address, channels in branches.items():
            yield address, Multiplexer(channels)

    def _spi_devices(self, config: SensorsConfig) -> Iterator[tuple[str, Mcp3008Device]]:
        channels: dict[str, dict[int, Beam]] = {}
        references_v: dict[str, float] = {}
        for beam, sharp in _of_kind(config, SharpOnMcp3008):
            channels.setdefault(sharp.device, {})[sharp.channel] = beam
            references_v[sharp.device] = sharp.reference_v
        for device, beams in channels.items():
            inputs = self._inputs(beams, f"MCP3008 {device}")
            yield device, Mcp3008Device(inputs.volts, references_v[device])

    def _tof(self, beam: Beam) -> TofUnit:
        unit = self._sensors[beam]
        assert isinstance(unit, TofUnit)
        return unit

    def _inputs(self, beams: Mapping[int, Beam], name: str) -> AdcInputs:
        """Voltages at an ADC's inputs."""
        units = {channel: self._sensors[beam] for channel, beam in beams.items()}
        sharps = {c: unit for c, unit in units.items() if isinstance(unit, SharpUnit)}
        return AdcInputs(sharps, stream(self._seed, f"open inputs of {name}"))


def physics_of(sensor: RangeSensor) -> SharpPhysics | TofPhysics:
    """Simulated physics of a configured sensor."""
    match sensor:
        case SharpOnAds1115() | SharpOnMcp3008():
            return PHYSICS[sensor.curve]
        case Vl53l1xSensor() | TfminiSensor():
            return TOF_PHYSICS[sensor.kind]
        case AutopilotRange():
            return TofPhysics(
                min_m=sensor.min_m,
                max_m=sensor.max_m,
                noise_m=sensor.sigma_m,
                noise_share=0.0,
                period_s=AUTOPILOTS_SENSOR_S,
                integration_s=0.0,
                gain_sigma=GAIN_SIGMA,
                resolution_m=0.01,
            )


def _of_kind(config: SensorsConfig, kind: type[Kind]) -> Iterator[tuple[Beam, Kind]]:
    return ((beam, s) for beam, s in config.beams.items() if isinstance(s, kind))


def _axis_frd(beam: Beam, sensor: RangeSensor) -> Vector3:
    """The sensor's axis in the body frame (FRD), a unit vector."""
    if sensor.bearing_deg is None:
        return BEAM_FRD[beam]
    bearing_rad = math.radians(sensor.bearing_deg)
    return math.cos(bearing_rad), math.sin(bearing_rad), 0.0


def _beam_query(
    axis_frd: Vector3,
    mount_offset_m: float,
    max_return_m: float,
    range_m: RangeQuery,
    truth_at: TruthAt,
) -> Callable[[float], float | None]:
    """The true range of one beam from the sensor's mounting point, as a function of time."""

    def query(time_s: float) -> float | None:
        truth = truth_at(time_s)
        direction = to_ned(axis_frd, truth)
        north, east, down = truth.position_ned_m
        origin = (
            north + mount_offset_m * direction[0],
            east + mount_offset_m * direction[1],
            down + mount_offset_m * direction[2],
        )
        return range_m(origin, direction, max_return_m)

    return query


def to_ned(vector_frd: Vector3, truth: TrueState) -> Vector3:
    """Rotate from body (FRD) to NED by roll, pitch, yaw (aerospace order, Z-Y-X)."""
    x, y, z = vector_frd
    cos_r, sin_r = math.cos(truth.roll_rad), math.sin(truth.roll_rad)
    cos_p, sin_p = math.cos(truth.pitch_rad), math.sin(truth.pitch_rad)
    cos_y, sin_y = math.cos(truth.yaw_rad), math.sin(truth.yaw_rad)
    y, z = cos_r * y - sin_r * z, sin_r * y + cos_r * z
    x, z = cos_p * x + sin_p * z, -sin_p * x + cos_p * z
    return cos_y * x - sin_y * y, sin_y * x + cos_y * y, z

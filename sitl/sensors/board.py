"""The sensor board: every chip and sensor of the drone on one bus."""

import math
from collections.abc import Callable
from dataclasses import replace

from companion.config import SensorsConfig
from companion.frames import Vector3
from companion.messages import Beam
from sitl.noise import stream
from sitl.sensors.ads1115 import Ads1115Device
from sitl.sensors.beam import RangeQuery
from sitl.sensors.i2c import Device, DeviceBus
from sitl.sensors.lsm9ds1 import Lsm9ds1Device, draw_warming
from sitl.sensors.sharp import PHYSICS, SharpUnit
from sitl.truth import STEP_S, TrueState

TruthAt = Callable[[float], TrueState]

BEAM_FRD: dict[Beam, Vector3] = {
    Beam.FRONT: (1.0, 0.0, 0.0),
    Beam.RIGHT: (0.0, 1.0, 0.0),
    Beam.BACK: (-1.0, 0.0, 0.0),
    Beam.LEFT: (0.0, -1.0, 0.0),
    Beam.UP: (0.0, 0.0, -1.0),
    Beam.DOWN: (0.0, 0.0, 1.0),
}


class SensorBoard:
    """Two ADS1115 with the range sensors on them, and the gyro."""

    def __init__(
        self,
        seed: int,
        config: SensorsConfig,
        range_query: Callable[[Beam], RangeQuery],
        truth_at: TruthAt,
        *,
        gain_sigma: float | None = None,
    ) -> None:
        physics = PHYSICS[config.profile]
        if gain_sigma is not None:
            physics = replace(physics, gain_sigma=gain_sigma)
        self._sensors: dict[Beam, SharpUnit] = {
            beam: SharpUnit(
                physics,
                _beam_query(
                    beam, config.mount_offset_m, physics.sees_to_m, range_query(beam), truth_at
                ),
                stream(seed, f"range sensor {beam.value}"),
            )
            for beam in config.channels
        }
        devices: dict[int, Device] = {
            address: Ads1115Device(self._voltage(config, address))
            for address in sorted({c.address for c in config.channels.values()})
        }
        devices[config.gyro_address] = Lsm9ds1Device(
            # A state's rate is that of the step which led to it.
            lambda time_s: truth_at(time_s + 0.5 * STEP_S).yaw_rate_rad_s,
            stream(seed, "gyro"),
            draw_warming(stream(seed, "gyro temperature")),
        )
        self.bus = DeviceBus(devices)

    def unplug(self, beam: str) -> None:
        """A fault for tests: a range sensor loses its plug."""
        self._sensors[Beam(beam)].is_unplugged = True

    def _voltage(self, config: SensorsConfig, address: int) -> Callable[[int, float], float]:
        inputs = {
            c.channel: self._sensors[beam]
            for beam, c in config.channels.items()
            if c.address == address
        }

        def volts(channel: int, time_s: float) -> float:
            return inputs[channel].volts(time_s) if channel in inputs else 0.0

        return volts


def _beam_query(
    beam: Beam, mount_offset_m: float, sees_to_m: float, range_m: RangeQuery, truth_at: TruthAt
) -> Callable[[float], float | None]:
    """The true range of one beam, from where the sensor sits."""

    def query(time_s: float) -> float | None:
        truth = truth_at(time_s)
        direction = to_ned(BEAM_FRD[beam], truth)
        north, east, down = truth.position_ned_m
        origin = (
            north + mount_offset_m * direction[0],
            east + mount_offset_m * direction[1],
            down + mount_offset_m * direction[2],
        )
        return range_m(origin, direction, sees_to_m)

    return query


def to_ned(vector_frd: Vector3, truth: TrueState) -> Vector3:
    """Body to NED by roll, pitch, yaw (aerospace order, Z-Y-X)."""
    x, y, z = vector_frd
    cos_r, sin_r = math.cos(truth.roll_rad), math.sin(truth.roll_rad)
    cos_p, sin_p = math.cos(truth.pitch_rad), math.sin(truth.pitch_rad)
    cos_y, sin_y = math.cos(truth.yaw_rad), math.sin(truth.yaw_rad)
    y, z = cos_r * y - sin_r * z, sin_r * y + cos_r * z
    x, z = cos_p * x + sin_p * z, -sin_p * x + cos_p * z
    return cos_y * x - sin_y * y, sin_y * x + cos_y * y, z

"""Builds the messages of the autopilot's own sensors: its gyro and connected rangefinders."""

import math
from collections.abc import Mapping
from random import Random

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.range_sensors import AutopilotRange
from companion.core.messages import Beam
from companion.drivers.autopilot import ORIENTATIONS
from sitl.autopilot.streams import Message
from sitl.sensors.time_of_flight import TofUnit

BIAS_RAD_S = math.radians(0.1)
SCALE = 0.005
NOISE_RAD_S = math.radians(0.05)
"""Standard deviations of the gyro's errors. Assumed: better than the companion's gyro, and
calibrated at boot."""
MAX_CM = 65535
"""Largest distance in DISTANCE_SENSOR (132), cm."""


class Imu:
    """The autopilot's gyro, yaw rate only. Every message is a new measurement."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._bias_rad_s = random.gauss(0, BIAS_RAD_S)
        self._scale = 1 + random.gauss(0, SCALE)

    def scaled(self, boot_ms: int, yaw_rate_rad_s: float) -> Message:
        """SCALED_IMU (26): mrad/s."""
        measured = round(1000 * self._measured_rad_s(yaw_rate_rad_s))
        return mavlink.MAVLink_scaled_imu_message(
            boot_ms, *(0, 0, -1000), *(0, 0, measured), *(0, 0, 0)
        )

    def highres(self, boot_us: int, yaw_rate_rad_s: float) -> Message:
        """HIGHRES_IMU (105): only accelerometer and gyro are updated."""
        measured = self._measured_rad_s(yaw_rate_rad_s)
        return mavlink.MAVLink_highres_imu_message(
            boot_us, *(0, 0, -9.81), *(0, 0, measured), *(0, 0, 0), *(0, 0, 0, 0), 0x3F
        )

    def _measured_rad_s(self, yaw_rate_rad_s: float) -> float:
        noise = self._random.gauss(0, NOISE_RAD_S)
        return yaw_rate_rad_s * self._scale + self._bias_rad_s + noise


def rangefinder_messages(
    rangefinders: Mapping[Beam, tuple[TofUnit, AutopilotRange]], boot_ms: int
) -> list[Message]:
    """DISTANCE_SENSOR (132) of each connected sensor; without a return, beyond the range."""
    orientations = {beam: orientation for orientation, beam in ORIENTATIONS.items()}
    messages = []
    for number, (beam, (unit, sensor)) in enumerate(rangefinders.items()):
        if unit.is_unplugged:
            continue
        distance_m = unit.distance_m(boot_ms * 1e-3)
        distance_m_or_max = sensor.max_m + 0.1 if distance_m is None else distance_m
        messages.append(
            mavlink.MAVLink_distance_sensor_message(
                boot_ms,
                *(round(100 * metres) for metres in (sensor.min_m, sensor.max_m)),
                min(round(100 * distance_m_or_max), MAX_CM),
                mavlink.MAV_DISTANCE_SENSOR_LASER,
                number,
                orientations[beam],
                0,
            )
        )
    return messages

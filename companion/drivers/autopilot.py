"""Sensors of the autopilot's, as it tells of them over MAVLink.

DISTANCE_SENSOR (132) by its orientation, HIGHRES_IMU (105, PX4) and SCALED_IMU (26, ArduPilot) for
the yaw rate, which they tell in body FRD. The link hands over the messages.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.drivers.readings import NOTHING, TOO_NEAR, Latest
from companion.messages import Beam, GyroSample, RangeReading, RangeState
from companion.range_config import AutopilotRange

ORIENTATIONS: dict[int, Beam] = {
    mavlink.MAV_SENSOR_ROTATION_NONE: Beam.FRONT,
    mavlink.MAV_SENSOR_ROTATION_YAW_90: Beam.RIGHT,
    mavlink.MAV_SENSOR_ROTATION_YAW_180: Beam.BACK,
    mavlink.MAV_SENSOR_ROTATION_YAW_270: Beam.LEFT,
    mavlink.MAV_SENSOR_ROTATION_PITCH_90: Beam.UP,
    mavlink.MAV_SENSOR_ROTATION_PITCH_270: Beam.DOWN,
}
RANGE_HZ, IMU_HZ, NOT_ASKED_FOR = 20.0, 50.0, 0.0
RANGE_FRESH_S = 0.2
"""Messages come when the autopilot has time for them."""
UNKNOWN_COVARIANCE, INVALID_QUALITY = 255, 1
CLOCK_DRIFT = 50e-6
"""Two quartzes part by no more, s/s."""


@dataclass(frozen=True, slots=True)
class AutopilotRangeModel:
    """What the configuration says of the autopilot's sensor; a `RangeModel`."""

    min_m: float
    max_m: float
    noise_m: float
    gain_sigma: float = 0.0
    mean_age_s: float = 0.5 / RANGE_HZ

    def sigma_m(self, distance_m: float) -> float:
        return self.noise_m

    def alias_m(self, distance_m: float) -> float | None:
        """It does not fold."""
        return None


class AutopilotRanges:
    """Range sensors of the autopilot's, by beam."""

    streams_hz: Mapping[int, float] = {mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: RANGE_HZ}

    def __init__(self, sensors: Mapping[Beam, AutopilotRange]) -> None:
        self.models = {
            beam: AutopilotRangeModel(sensor.min_m, sensor.max_m, sensor.sigma_m)
            for beam, sensor in sensors.items()
        }
        self._latest = {beam: Latest(RANGE_FRESH_S) for beam in sensors}

    def hear(self, message: Any, now_s: float) -> None:
        """Take in a DISTANCE_SENSOR; another beam's, or nobody's, changes nothing."""
        beam = ORIENTATIONS.get(message.orientation)
        if beam in self._latest:
            self._latest[beam].note(now_s, _reading(message, self.models[beam]))

    def read(self, time_s: float) -> dict[Beam, RangeReading]:
        """The beams that have been heard of lately."""
        at = {beam: latest.at(time_s) for beam, latest in self._latest.items()}
        return {beam: reading for beam, reading in at.items() if reading is not None}


def _reading(message: Any, model: AutopilotRangeModel) -> RangeReading | None:
    """None for what the autopilot itself calls invalid."""
    if message.signal_quality == INVALID_QUALITY:
        return None
    distance_m = message.current_distance * 1e-2
    if distance_m < max(model.min_m, message.min_distance * 1e-2):
        return TOO_NEAR
    if distance_m >= min(model.max_m, message.max_distance * 1e-2):
        return NOTHING
    told = message.covariance not in (0, UNKNOWN_COVARIANCE)
    variance_m2 = message.covariance * 1e-4 if told else model.noise_m**2
    return RangeReading(RangeState.DISTANCE, distance_m, variance_m2)


class AutopilotGyro:
    """The autopilot's gyro; the better of its messages, as far as it sends both."""

    streams_hz: Mapping[int, float] = {
        mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: NOT_ASKED_FOR,
        mavlink.MAVLINK_MSG_ID_SCALED_IMU: IMU_HZ,
    }
    """PX4 streams the first by itself, ArduPilot may not have it and would complain."""
    _TOLD: Mapping[str, Callable[[Any], tuple[float, float]]] = {
        "HIGHRES_IMU": lambda m: (m.time_usec * 1e-6, m.zgyro),
        "SCALED_IMU": lambda m: (m.time_boot_ms * 1e-3, m.zgyro * 1e-3),
    }
    """Time since its boot, s, and yaw rate, rad/s."""

    def __init__(self) -> None:
        self._samples: list[GyroSample] = []
        self._has_highres = False
        self._offset_s = math.inf
        """From its clock to ours: the quickest message so far had the shortest way."""
        self._heard_s = 0.0
        self._told_s = self._last_s = -math.inf

    def hear(self, message: Any, now_s: float) -> None:
        """Take in one sample, by its own time; an older one than the last changes nothing."""
        kind = message.get_type()
        self._has_highres |= kind == "HIGHRES_IMU"
        if kind == "SCALED_IMU" and self._has_highres:
            return
        boot_s, yaw_rate_rad_s = self._TOLD[kind](message)
        if not math.isfinite(yaw_rate_rad_s) or boot_s <= self._told_s:
            return
        self._told_s = boot_s
        self._offset_s += CLOCK_DRIFT * (now_s - self._heard_s)
        self._offset_s = min(self._offset_s, now_s - boot_s)
        self._heard_s = now_s
        time_s = boot_s + self._offset_s
        if time_s > self._last_s:  # a quicker message has just shown that it is earlier
            self._last_s = time_s
            self._samples.append(GyroSample(time_s, yaw_rate_rad_s))

    def read(self, time_s: float) -> list[GyroSample]:
        """All samples since the last read."""
        samples, self._samples = self._samples, []
        return samples

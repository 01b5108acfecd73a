"""Range sensors of the autopilot's, as it tells of them over MAVLink.

DISTANCE_SENSOR (132) by its orientation. The link hands over the messages.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.range_sensors import AutopilotRange
from companion.core.messages import Beam, RangeReading, RangeState
from companion.drivers.readings import NOTHING, TOO_NEAR, Latest

ORIENTATIONS: dict[int, Beam] = {
    mavlink.MAV_SENSOR_ROTATION_NONE: Beam.FRONT,
    mavlink.MAV_SENSOR_ROTATION_YAW_90: Beam.RIGHT,
    mavlink.MAV_SENSOR_ROTATION_YAW_180: Beam.BACK,
    mavlink.MAV_SENSOR_ROTATION_YAW_270: Beam.LEFT,
    mavlink.MAV_SENSOR_ROTATION_PITCH_90: Beam.UP,
    mavlink.MAV_SENSOR_ROTATION_PITCH_270: Beam.DOWN,
}
RANGE_HZ = 20.0
RANGE_FRESH_S = 0.2
"""Messages come when the autopilot has time for them."""
UNKNOWN_COVARIANCE, INVALID_QUALITY = 255, 1
NO_DISTANCE_CM = (0, 0xFFFF)
"""What drivers tell that have measured none: of what is too near they tell less than their least,
of what is out of range more than their most."""


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
    """None for what the autopilot itself calls invalid, and for what no sensor measures."""
    if message.signal_quality == INVALID_QUALITY or message.current_distance in NO_DISTANCE_CM:
        return None
    distance_m = message.current_distance * 1e-2
    least_m, most_m = _bounds_m(message, model)
    if distance_m < least_m:
        return TOO_NEAR
    if distance_m >= most_m:
        return NOTHING
    told = message.covariance not in (0, UNKNOWN_COVARIANCE)
    variance_m2 = message.covariance * 1e-4 if told else model.noise_m**2
    return RangeReading(RangeState.DISTANCE, distance_m, variance_m2)


def _bounds_m(message: Any, model: AutopilotRangeModel) -> tuple[float, float]:
    """The narrower of ours and those that it tells, unless it tells none."""
    if message.max_distance <= message.min_distance:
        return model.min_m, model.max_m
    least_m, most_m = message.min_distance * 1e-2, message.max_distance * 1e-2
    return max(model.min_m, least_m), min(model.max_m, most_m)

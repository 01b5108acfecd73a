"""Range sensors of the autopilot, reported over MAVLink as DISTANCE_SENSOR (132).

The orientation field determines the beam. The link passes the messages.

Several sensors may have one orientation: an ArduPilot with PRX1_TYPE 4 sends each rangefinder again
as proximity, after its own processing, with id 10 and above (`PROXIMITY_SENSOR_ID_START` in its
AP_Proximity.h). Of those only the sensor with the lowest id is read.
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
"""Beam of each MAV_SENSOR_ORIENTATION."""
RANGE_HZ = 20.0
"""Requested rate of DISTANCE_SENSOR, Hz. Chosen."""
RANGE_FRESH_S = 0.2
"""A reading is fresh for this time, s. Chosen: the autopilot sends messages irregularly."""
FORGOTTEN_S = 5.0
"""A sensor with a higher id is read after this silence of the one before, s. Chosen: longer than
the silence after which the drone lands; a restarted autopilot may number its sensors anew."""
UNKNOWN_COVARIANCE, INVALID_QUALITY = 255, 1
"""Values of DISTANCE_SENSOR: unknown covariance; invalid signal quality."""
NO_DISTANCE_CM = (0, 0xFFFF)
"""Distances that drivers report without a measurement. TOO_NEAR is below the minimum distance
instead, and nothing in range is above the maximum."""


@dataclass(frozen=True, slots=True)
class AutopilotRangeModel:
    """Model of the autopilot's sensor by the configuration; a `RangeModel`."""

    min_m: float
    max_m: float
    noise_m: float
    gain_sigma: float = 0.0
    mean_age_s: float = 0.5 / RANGE_HZ

    def sigma_m(self, distance_m: float) -> float:
        return self.noise_m

    def alias_m(self, distance_m: float) -> float | None:
        """No aliasing."""
        return None


class AutopilotRanges:
    """The autopilot's range sensors, by beam."""

    streams_hz: Mapping[int, float] = {mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: RANGE_HZ}

    def __init__(self, sensors: Mapping[Beam, AutopilotRange]) -> None:
        self.models = {
            beam: AutopilotRangeModel(sensor.min_m, sensor.max_m, sensor.sigma_m)
            for beam, sensor in sensors.items()
        }
        self._latest = {beam: Latest(RANGE_FRESH_S) for beam in sensors}
        self._read_from: dict[Beam, tuple[int, float]] = {}
        """Id of the sensor, and time of its last message, s."""

    def receive(self, message: Any, now_s: float) -> None:
        """Process a DISTANCE_SENSOR message; messages of other orientations are ignored."""
        beam = ORIENTATIONS.get(message.orientation)
        if beam in self._latest and self._is_read(beam, message.id, now_s):
            self._latest[beam].note(now_s, _reading(message, self.models[beam]))

    def _is_read(self, beam: Beam, sensor_id: int, now_s: float) -> bool:
        known_id, heard_s = self._read_from.get(beam, (sensor_id, now_s))
        if sensor_id > known_id and now_s - heard_s <= FORGOTTEN_S:
            return False
        self._read_from[beam] = sensor_id, now_s
        return True

    def read(self, time_s: float) -> dict[Beam, RangeReading]:
        """Readings of the beams with a fresh message."""
        at = {beam: latest.at(time_s) for beam, latest in self._latest.items()}
        return {beam: reading for beam, reading in at.items() if reading is not None}


def _reading(message: Any, model: AutopilotRangeModel) -> RangeReading | None:
    """Reading of a message; None if it is invalid or contains no measurement."""
    if message.signal_quality == INVALID_QUALITY or message.current_distance in NO_DISTANCE_CM:
        return None
    distance_m = message.current_distance * 1e-2
    least_m, most_m = _bounds_m(message, model)
    if distance_m < least_m:
        return TOO_NEAR
    if distance_m >= most_m:
        return NOTHING
    is_known = message.covariance not in (0, UNKNOWN_COVARIANCE)
    variance_m2 = message.covariance * 1e-4 if is_known else model.noise_m**2
    return RangeReading(RangeState.DISTANCE, distance_m, variance_m2)


def _bounds_m(message: Any, model: AutopilotRangeModel) -> tuple[float, float]:
    """The narrower limits of the configuration and of the message, if it contains any."""
    if message.max_distance <= message.min_distance:
        return model.min_m, model.max_m
    least_m, most_m = message.min_distance * 1e-2, message.max_distance * 1e-2
    return max(model.min_m, least_m), min(model.max_m, most_m)

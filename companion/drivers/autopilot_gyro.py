"""The autopilot's gyro, reported over MAVLink.

HIGHRES_IMU (105, PX4) and SCALED_IMU (26, ArduPilot) contain the yaw rate in body FRD. The link
passes the messages.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.boot_clock import BootClock
from companion.core.messages import GyroSample

IMU_HZ, NOT_REQUESTED = 50.0, 0.0
"""Requested rate, Hz, Chosen; and the value for messages that are not requested."""
HIGHRES_GAP_S = 0.1
"""HIGHRES_IMU is used while it arrives at least this often, s. Chosen: five periods of `IMU_HZ`."""
MAX_RATE_RAD_S = math.radians(2000)
"""Largest measurable rate of an autopilot's gyro, rad/s. Chosen."""


class AutopilotGyro:
    """The autopilot's gyro, by the better one of its messages."""

    streams_hz: Mapping[int, float] = {
        mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: NOT_REQUESTED,
        mavlink.MAVLINK_MSG_ID_SCALED_IMU: IMU_HZ,
    }
    """PX4 streams the first without a request; ArduPilot may lack it and would report an error. A
    ground station on the same link may have requested it at a few Hz: then the second is used."""
    _DECODERS: Mapping[str, Callable[[Any], tuple[float, float]]] = {
        "HIGHRES_IMU": lambda m: (m.time_usec * 1e-6, m.zgyro),
        "SCALED_IMU": lambda m: (m.time_boot_ms * 1e-3, m.zgyro * 1e-3),
    }
    """Time since boot, s, and yaw rate, rad/s, of a message."""

    def __init__(self) -> None:
        self._samples: list[GyroSample] = []
        self._is_highres_used = False
        self._highres_s = -math.inf
        self._clock = BootClock()
        self._boot_s = self._last_s = -math.inf

    def receive(self, message: Any, now_s: float) -> None:
        """Process one sample by its own time; samples older than the last are ignored."""
        kind = message.get_type()
        is_highres, is_frequent = kind == "HIGHRES_IMU", now_s - self._highres_s <= HIGHRES_GAP_S
        if is_highres:
            self._highres_s, self._is_highres_used = now_s, is_frequent
        if is_highres != (self._is_highres_used and is_frequent):
            return
        boot_s, yaw_rate_rad_s = self._DECODERS[kind](message)
        if self._clock.receive(boot_s, now_s):
            self._boot_s = -math.inf
        if boot_s <= self._boot_s or not abs(yaw_rate_rad_s) <= MAX_RATE_RAD_S:  # nor NaN
            return
        self._boot_s = boot_s
        time_s = min(self._clock.time_s(boot_s), now_s)
        if time_s > self._last_s:  # a new clock offset may put it before the last one
            self._last_s = time_s
            self._samples.append(GyroSample(time_s, yaw_rate_rad_s))

    def read(self, time_s: float) -> list[GyroSample]:
        """All samples since the last read."""
        samples, self._samples = self._samples, []
        return samples

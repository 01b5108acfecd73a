"""Estimates the gyro's bias as its mean rate while the drone stands still before take-off."""

import math
from collections.abc import Sequence

from companion.core.messages import GyroSample

MAX_RATE_SPREAD_RAD_S = math.radians(3.0)
"""A sample this far from the mean indicates that the drone is being moved, rad/s. Chosen."""
MIN_SAMPLES = 20
"""Least samples of one calibration. Chosen."""


class RestCalibration:
    """Averages over periods of `rest_s` at rest, repeatedly. Motion restarts the period."""

    def __init__(self, rest_s: float) -> None:
        self._rest_s = rest_s
        self._began_s = 0.0
        self._sum_rad_s = 0.0
        self._count = 0
        self.bias_rad_s: float | None = None
        """Bias of the last complete period, rad/s; None before the first."""

    def add(self, samples: Sequence[GyroSample]) -> bool:
        """Add samples; True if a period of rest was completed."""
        return sum(map(self._add, samples)) > 0

    def _add(self, sample: GyroSample) -> bool:
        mean = self._sum_rad_s / self._count if self._count else sample.yaw_rate_rad_s
        if self._count == 0 or abs(sample.yaw_rate_rad_s - mean) > MAX_RATE_SPREAD_RAD_S:
            self._began_s, self._sum_rad_s, self._count = sample.time_s, 0.0, 0
        self._sum_rad_s += sample.yaw_rate_rad_s
        self._count += 1
        still_s = sample.time_s - self._began_s
        if still_s < self._rest_s or self._count < MIN_SAMPLES:
            return False
        self.bias_rad_s = self._sum_rad_s / self._count
        self._count, self._sum_rad_s = 0, 0.0
        return True

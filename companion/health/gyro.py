"""Whether the gyro can be believed, and what turned the drone while it was silent."""

import math
from collections.abc import Sequence

from companion.frames import wrap_rad
from companion.messages import GyroSample, Odometry

MOST_RATE_RAD_S = math.radians(240)
"""Nearly what the LSM9DS1 can tell: it may be more."""
GAP_S = 0.25
TOLD_S = 0.1
"""The autopilot's heading is as old as that at most when a gap is bridged."""
MEMORY_S = 5.0
"""The two turns are compared over this time, the older the less."""
APART_RAD, APART_SHARE = math.radians(4.0), 0.08
"""So far apart they may be: biases, and scales by how much was turned."""
STEP_RAD = math.radians(5.0)
"""An autopilot that aligns its heading anew turns it by more in one tick."""


class GyroWatch:
    """Compares how far gyro and autopilot have turned."""

    def __init__(self) -> None:
        self.heard_s = -math.inf
        """When the latest sample came."""
        self.turned_rad = 0.0
        """In all, by the gyro without its bias."""
        self._sample_s: float | None = None
        self._yaw_rad: float | None = None
        """The autopilot's, as last told."""
        self._told_s = -math.inf
        self._yaw_before_gap_rad: float | None = None
        self._compared_rad = 0.0
        self._compared_s = -math.inf
        self._apart_rad = self._turning_rad = 0.0
        self._is_saturated = False

    @property
    def complaint(self) -> str:
        """Why it cannot be believed; or nothing."""
        if self._is_saturated:
            return "the gyro is saturated"
        if abs(self._apart_rad) > APART_RAD + APART_SHARE * self._turning_rad:
            return "gyro and autopilot do not turn alike"
        return ""

    def take(
        self,
        now_s: float,
        samples: Sequence[GyroSample],
        odometry: Odometry | None,
        bias_rad_s: float | None,
    ) -> Sequence[GyroSample]:
        """The samples; the first after a silence carries the turn that the autopilot saw in it.

        They wait until it has told its heading. Before the bias is known, nothing is compared.
        """
        if odometry is not None:
            self._told_s = now_s
        if not all(math.isfinite(sample.yaw_rate_rad_s) for sample in samples):
            samples = [sample for sample in samples if math.isfinite(sample.yaw_rate_rad_s)]
        is_after_gap = bool(samples) and self._is_gap_before(samples[0])
        if is_after_gap and now_s - self._told_s > TOLD_S:
            samples = ()
        if samples:
            self.heard_s = now_s
            if is_after_gap:
                samples = self._bridged(samples, odometry, bias_rad_s or 0.0)
            self._is_saturated = any(abs(s.yaw_rate_rad_s) > MOST_RATE_RAD_S for s in samples)
            self._integrate(samples, bias_rad_s or 0.0)
        if odometry is not None:
            if now_s - self.heard_s <= GAP_S:
                self._compare(now_s, odometry.yaw_rad)
            self._yaw_rad = odometry.yaw_rad
        if bias_rad_s is None:
            self._apart_rad = self._turning_rad = 0.0
        if samples:
            self._yaw_before_gap_rad = self._yaw_rad
        return samples

    def _is_gap_before(self, sample: GyroSample) -> bool:
        return self._sample_s is not None and sample.time_s - self._sample_s > GAP_S

    def _bridged(
        self, samples: Sequence[GyroSample], odometry: Odometry | None, bias_rad_s: float
    ) -> Sequence[GyroSample]:
        first = samples[0]
        assert self._sample_s is not None
        self._apart_rad = 0.0
        self._compared_s = -math.inf
        yaw_rad = self._yaw_rad if odometry is None else odometry.yaw_rad
        if yaw_rad is None or self._yaw_before_gap_rad is None:
            return samples
        turned_rad = wrap_rad(yaw_rad - self._yaw_before_gap_rad)
        rate_rad_s = turned_rad / (first.time_s - self._sample_s) + bias_rad_s
        return [GyroSample(first.time_s, rate_rad_s), *samples[1:]]

    def _integrate(self, samples: Sequence[GyroSample], bias_rad_s: float) -> None:
        for sample in samples:
            if self._sample_s is not None:
                dt_s = sample.time_s - self._sample_s
                self.turned_rad += (sample.yaw_rate_rad_s - bias_rad_s) * dt_s
            self._sample_s = sample.time_s

    def _compare(self, now_s: float, yaw_rad: float) -> None:
        """Once for each odometry."""
        last_rad = self._yaw_rad
        by_gyro_rad = self.turned_rad - self._compared_rad
        self._compared_rad = self.turned_rad
        dt_s = now_s - self._compared_s
        self._compared_s = now_s
        if last_rad is None or dt_s > MEMORY_S:
            return
        by_autopilot_rad = wrap_rad(yaw_rad - last_rad)
        if abs(by_autopilot_rad) > STEP_RAD * max(dt_s / 0.05, 1.0) + abs(by_gyro_rad):
            return
        fade = math.exp(-dt_s / MEMORY_S)
        self._apart_rad = fade * self._apart_rad + by_gyro_rad - by_autopilot_rad
        self._turning_rad = fade * self._turning_rad + abs(by_autopilot_rad)

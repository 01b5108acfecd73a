"""Models time-of-flight range sensors: when they measure, and their errors."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from random import Random

from companion.core.messages import RangeModel
from companion.drivers.chips.time_of_flight import TF_LUNA, TFMINI_S, VL53L1X

TrueRange = Callable[[float], float | None]
"""time_s -> true distance along the beam, m; None without a surface."""


@dataclass(frozen=True, slots=True)
class TofPhysics:
    """Deviation of a unit from its datasheet, and its noise."""

    model: RangeModel
    period_s: float
    integration_s: float
    """Integration time, s. A reading is the mean over this time, which ends with the reading."""
    gain_sigma: float
    """Standard deviation of the units' gain."""
    resolution_m: float
    period_spread: float = 0.02
    """Relative standard deviation of the units' clocks."""

    @property
    def max_return_m(self) -> float:
        return 1.1 * self.model.max_m


TOF_PHYSICS = {
    "vl53l1x": TofPhysics(VL53L1X, VL53L1X.period_s, 0.033, VL53L1X.gain_sigma, 0.001),
    "tfmini_s": TofPhysics(TFMINI_S, TFMINI_S.period_s, 0.0, TFMINI_S.gain_sigma, 0.01),
    "tf_luna": TofPhysics(TF_LUNA, TF_LUNA.period_s, 0.0, TF_LUNA.gain_sigma, 0.01),
}
"""Physics by kind of sensor; sources are in docs/sensors.md."""


class TofUnit:
    """One sensor that measures at its own clock. Computed on demand."""

    def __init__(self, physics: TofPhysics, true_range: TrueRange, random: Random) -> None:
        self._physics = physics
        self.true_range = true_range
        self._random = random
        self._period_s = physics.period_s * (1 + random.gauss(0, physics.period_spread))
        self._phase_s = random.uniform(0, self._period_s)
        self.gain = 1 + random.gauss(0, physics.gain_sigma)
        self._count = -1
        self._distance_m: float | None = None
        self.is_unplugged = self.is_stuck = False
        self.noise_factor = 1.0
        """Faults for tests."""

    def count(self, time_s: float) -> int:
        """Number of measurements that have ended by `time_s`."""
        return int((time_s + self._phase_s) / self._period_s)

    @property
    def measured(self) -> int:
        """Number of the measurement that was read last."""
        return self._count

    def distance_m(self, time_s: float) -> float | None:
        """The latest measurement that has ended by `time_s`, m; None if no light returned."""
        count = self.count(time_s)
        if count != self._count and not self.is_stuck:
            self._count = count
            self._distance_m = self._measure(count * self._period_s - self._phase_s)
        return self._distance_m

    def _measure(self, ended_s: float) -> float | None:
        physics = self._physics
        true_m = self.true_range(ended_s - physics.integration_s / 2)
        noise = self.noise_factor * self._random.gauss(0, 1)
        if true_m is None:
            return None
        model = physics.model
        within_m = min(max(true_m, model.min_m), model.max_m)
        sigma2_m2 = model.sigma_m(within_m) ** 2 - (model.gain_sigma * within_m) ** 2
        measured_m = true_m * self.gain + noise * math.sqrt(sigma2_m2)
        steps = max(0, round(measured_m / physics.resolution_m))
        return steps * physics.resolution_m

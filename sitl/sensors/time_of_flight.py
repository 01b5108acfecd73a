"""Models time-of-flight range sensors: when they measure, and their errors.

Figures are those of datasheet and product manuals, not of the companion's measurement models.
"""

from collections.abc import Callable
from dataclasses import dataclass
from random import Random

TrueRange = Callable[[float], float | None]
"""time_s -> true distance along the beam, m; None without a surface."""


@dataclass(frozen=True, slots=True)
class TofPhysics:
    """Deviation of a unit from its datasheet, and its noise."""

    min_m: float
    max_m: float
    """Specified range, m. Outside, the noise is that of the range's end."""
    noise_m: float
    """Standard deviation of a reading at short range, m."""
    noise_share: float
    """Standard deviation of a reading at long range, over its distance. The larger one applies."""
    period_s: float
    """Interval of the measurements, s."""
    integration_s: float
    """Integration time, s. A reading is the mean over this time, which ends with the reading."""
    gain_sigma: float
    """Standard deviation of the units' gain."""
    resolution_m: float
    """Step of a reading, m."""
    period_spread: float = 0.02
    """Relative standard deviation of the units' clocks."""

    @property
    def max_return_m(self) -> float:
        """Light from farther away does not return, m. Chosen: 10 % beyond the specified range."""
        return 1.1 * self.max_m


GAIN_SIGMA = 0.003
"""Standard deviation of the units' gain. Assumed, as for the Sharp sensor (docs/sensors.md)."""
VL53L1X = TofPhysics(
    min_m=0.04,
    max_m=3.6,
    noise_m=0.010,
    noise_share=0.0,
    period_s=0.040,
    integration_s=0.033,
    gain_sigma=GAIN_SIGMA,
    resolution_m=0.001,
)
"""Long distance mode, white target, ±20 mm read as two sigma (DS12385). Interval and integration
time are those that the companion sets."""
TFMINI_S = TofPhysics(
    min_m=0.1,
    max_m=12.0,
    noise_m=0.06 / 3,
    noise_share=0.01 / 3,
    period_s=0.010,
    integration_s=0.0,
    gain_sigma=GAIN_SIGMA,
    resolution_m=0.01,
)
"""±6 cm up to 6 m, ±1 % beyond, read as three sigma; 100 frames a second (product manual)."""
TF_LUNA = TofPhysics(
    min_m=0.2,
    max_m=8.0,
    noise_m=0.06 / 3,
    noise_share=0.02 / 3,
    period_s=0.010,
    integration_s=0.0,
    gain_sigma=GAIN_SIGMA,
    resolution_m=0.01,
)
"""±6 cm up to 3 m, ±2 % beyond, read as three sigma; 100 frames a second (product manual)."""
TOF_PHYSICS = {"vl53l1x": VL53L1X, "tfmini_s": TFMINI_S, "tf_luna": TF_LUNA}
"""Physics by kind of sensor."""


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
        within_m = min(max(true_m, physics.min_m), physics.max_m)
        sigma_m = max(physics.noise_m, physics.noise_share * within_m)
        measured_m = true_m * self.gain + noise * sigma_m
        steps = max(0, round(measured_m / physics.resolution_m))
        return steps * physics.resolution_m

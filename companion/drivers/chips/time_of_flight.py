"""Measurement models of time-of-flight sensors.

Figures: VL53L1X datasheet (DS12385), long distance mode, white target; product manuals of TFmini-S
and TF-Luna. Their "accuracy" is taken as three sigma, or as two where it is called typical.
"""

import math
from dataclasses import dataclass

from companion.core.messages import RangeReading, RangeState
from companion.drivers.readings import NOTHING, TOO_NEAR


@dataclass(frozen=True, slots=True)
class TimeOfFlight:
    """One type of sensor; a `RangeModel`."""

    min_m: float
    max_m: float
    noise_m: float
    """Sigma of a reading at short range, m."""
    noise_share: float
    """Sigma of a reading at long range over its distance; the larger of both applies."""
    gain_sigma: float
    period_s: float
    mean_age_s: float

    def sigma_m(self, distance_m: float) -> float:
        noise_m = max(self.noise_m, self.noise_share * distance_m)
        return math.hypot(noise_m, self.gain_sigma * distance_m)

    def alias_m(self, distance_m: float) -> float | None:
        """No aliasing."""
        return None

    def reading(self, distance_m: float) -> RangeReading:
        """Reading of a measured distance."""
        if distance_m < self.min_m:
            return TOO_NEAR
        if distance_m > self.max_m:
            return NOTHING
        return RangeReading(RangeState.DISTANCE, distance_m, self.sigma_m(distance_m) ** 2)


VL53L1X = TimeOfFlight(
    min_m=0.04,
    max_m=3.6,
    noise_m=0.010,
    noise_share=0.0,
    gain_sigma=0.003,
    period_s=0.040,
    mean_age_s=0.040 / 2 + 0.033 / 2,
)
"""±20 mm. Integration time 33 ms, interval 40 ms."""
TFMINI_S = TimeOfFlight(0.1, 12.0, 0.02, 0.01 / 3, 0.003, 0.010, 0.006)
"""±6 cm up to 6 m, ±1 % beyond; a frame of 9 bytes every 10 ms."""
TF_LUNA = TimeOfFlight(0.2, 8.0, 0.02, 0.02 / 3, 0.003, 0.010, 0.006)
"""±6 cm up to 3 m, ±2 % beyond."""
SERIAL_KINDS = {"tfmini_s": TFMINI_S, "tf_luna": TF_LUNA}
"""Model of each serial sensor type."""

"""Estimates height above the take-off point: the autopilot's motion, corrected by the down beam.

A barometer drifts by centimetres in a minute; the distance to the floor does not. One state,
predicted by changes of the autopilot's height, corrected by the distance to the floor (Kalman):

    P ← P + q·dt     K = P / (P + σ²)     h ← h + K·(d - h)     P ← (1 - K)·P

A reading that differs by more than a step is not of the floor: a table top, a box, or the floor of
a lower room. Then only the autopilot's height counts.
"""

from companion.core.messages import RangeReading

WALK_M2_S = 0.002**2
"""Drift of the autopilot's height, m²/s. Chosen."""
MIN_SIGMA_M = 0.02
"""Least sigma of a floor distance, m. Chosen."""
STEP_M = 0.12
"""A larger difference is not the floor, m. Chosen."""


class Height:
    """Height above the take-off point, which is on the floor, m."""

    def __init__(self) -> None:
        self.metres = 0.0
        self._variance_m2 = 0.0

    def move(self, up_m: float, dt_s: float) -> None:
        """Predict by the autopilot's climb over `dt_s`."""
        self.metres += up_m
        self._variance_m2 += WALK_M2_S * dt_s

    def see_floor(self, reading: RangeReading, offset_m: float) -> None:
        """Correct by the down beam's reading; its sensor sits `offset_m` below the centre."""
        if not reading.is_distance:
            return
        off_m = reading.distance_m + offset_m - self.metres
        if abs(off_m) > STEP_M:
            return
        variance_m2 = max(reading.variance_m2, MIN_SIGMA_M**2)
        gain = self._variance_m2 / (self._variance_m2 + variance_m2)
        self.metres += gain * off_m
        self._variance_m2 *= 1 - gain

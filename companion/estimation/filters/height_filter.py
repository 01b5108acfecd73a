"""Height above the take-off point: the autopilot's motion, held to the floor by the down beam.

A barometer drifts by centimetres in a minute; the floor does not. One state, predicted by how the
autopilot's height changes, corrected by distance to the floor (Kalman):

    P ← P + q·dt     K = P / (P + σ²)     h ← h + K·(d - h)     P ← (1 - K)·P

What the beam meets is not the floor if that were further off than a step: a table top, a box, or
the floor of a room that lies lower. There the autopilot's height goes on alone.
"""

from companion.core.messages import RangeReading

WALK_M2_S = 0.002**2
"""How the autopilot's height drifts."""
MIN_SIGMA_M = 0.02
STEP_M = 0.12


class Height:
    """Metres above the take-off point, which is on the floor."""

    def __init__(self) -> None:
        self.metres = 0.0
        self._variance_m2 = 0.0

    def move(self, up_m: float, dt_s: float) -> None:
        """So far up by the autopilot."""
        self.metres += up_m
        self._variance_m2 += WALK_M2_S * dt_s

    def see_floor(self, reading: RangeReading, offset_m: float) -> None:
        """Take in the down beam's reading; its sensor sits `offset_m` below the centre."""
        if not reading.is_distance:
            return
        off_m = reading.distance_m + offset_m - self.metres
        if abs(off_m) > STEP_M:
            return
        variance_m2 = max(reading.variance_m2, MIN_SIGMA_M**2)
        gain = self._variance_m2 / (self._variance_m2 + variance_m2)
        self.metres += gain * off_m
        self._variance_m2 *= 1 - gain

"""Checks whether the walls determine the odometry's scale.

Along a corridor they do not. If the heading errors exceed the odometry's model, the odometry leads
through the corridor's walls, and less so for a shorter path. So the estimated scale shrinks while
all hits stay on the two walls. Therefore a scale error that is unlikely by the model is kept only
if the map with it predicts held-out ranges better.
"""

from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import Measured
from companion.offline.growth import IncrementalMap
from companion.offline.held_out import gains

LIKELY_SIGMAS = 2.0
"""A larger scale error is unlikely, in sigmas of the odometry's scale; 1 in 20 exceeds it.
Chosen."""
MIN_DIFFERENCE = 0.15
"""Least difference of the gains, nats per range. Measured on synthetic logs: up to 0.08 in
corridors where the scale shrank by 20 to 40 %; 0.24 and more in rooms and closed corridors where
odometry was off by 20 %."""


def with_supported_scale(
    estimated: IncrementalMap, m: Measured, units: RangeUnits
) -> IncrementalMap:
    """The solution itself, or the solution with the odometry's own scale."""
    sigma = estimated.smoother.models.odometry.scale_sigma
    if abs(estimated.x.odometry_scale[0]) < LIKELY_SIGMAS * sigma:
        return estimated
    fixed = estimated.with_fixed_scale()
    gained = gains(estimated, m, units) - gains(fixed, m, units)
    return estimated if gained.mean() > MIN_DIFFERENCE else fixed

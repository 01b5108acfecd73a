"""Whether walls tell how wrong the odometry's scale is.

Along a corridor they do not. If headings err by more than the odometry's model allows, the odometry
leads through the corridor's walls, by less the shorter the way is. So the scale shrinks, and all
hits still lie on the two walls. A scale error that is unlikely by the model is therefore kept only
if the map predicts left-out ranges better with it than without.
"""

from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import Measured
from companion.offline.growth import Growth
from companion.offline.held_out import gain

LIKELY_SIGMAS = 2.0
"""Of the odometry's scale; 1 in 20 is farther off."""
MIN_DIFFERENCE = 0.15
"""Nats a range. Measured on made-up logs: up to 0.08 in corridors where the scale shrank by 20 to
40 %, 0.24 and more in rooms and corridors with ends where odometry was off by 20 %."""


def with_supported_scale(found: Growth, m: Measured, units: RangeUnits) -> Growth:
    """What was found, or the same with the odometry's own scale."""
    sigma = found.smoother.models.odometry.scale_sigma
    if abs(found.x.odometry_scale) < LIKELY_SIGMAS * sigma:
        return found
    held = found.held_to_scale()
    return found if gain(found, m, units) - gain(held, m, units) > MIN_DIFFERENCE else held

"""Whether walls tell how wrong the odometry's scale is.

Along a corridor they do not. If the heading errs by more than its model has it, the odometry drives
the path through the corridor's walls, and the less the shorter it is: the scale shrinks, and all
that was met still lies on the two walls. So a scale that is hard to believe must pay: the map must
tell ranges that it was not made from better than with the odometry's own scale.
"""

from companion.estimation.range_units import RangeUnits
from companion.estimation.unknowns import Measured
from companion.offline.growth import Growth
from companion.offline.held_out import gain

BELIEVED_SIGMAS = 2.0
"""Of the odometry's scale; 1 in 20 is farther off."""
LEAST_PAID = 0.15
"""Nats a range. Measured on made-up logs: up to 0.08 in corridors where the scale shrank by 20 to
40 %, 0.24 and more in rooms and corridors with ends where odometry was off by 20 %."""


def with_scale_that_pays(found: Growth, m: Measured, units: RangeUnits) -> Growth:
    """What was found, or the same with the odometry's own scale."""
    sigma = found.smoother.models.odometry.scale_sigma
    if abs(found.x.odometry_scale) < BELIEVED_SIGMAS * sigma:
        return found
    held = found.held_to_scale()
    return found if gain(found, m, units) - gain(held, m, units) > LEAST_PAID else held

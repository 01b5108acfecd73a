"""Computes the stand-off distance from the sensor model and the configured choice.

The choices are the sensor's useful maximum, its most accurate distance, or a fixed distance.
"""

from companion.config.settings import Standoff
from companion.core.messages import RangeModel

STEP_M = 0.05
"""Step of the search over distances, m. Chosen."""
SURELY_SIGMAS = 3.0
"""A wall at the stand-off must stay in range with this much noise, in sigmas. Chosen."""
WORTH_SIGMA_M = 0.10
"""Maximum sigma of a range reading that is useful for the map, m. Chosen."""
MIN_M, MARGIN_M = 0.8, 0.25
"""Minimum distance to any wall, and margin beyond the sensor's minimum range, m.

Chosen: the margin keeps a gust from moving the drone below the sensor's minimum range.
"""
WANDER_SIGMAS = 3.0
"""Margin for the drift of the autopilot's position estimate, in sigmas, added to `MARGIN_M`.
Chosen."""


def standoff_m(
    wanted: Standoff, sensor: RangeModel, mount_offset_m: float, wander_m: float = 0.0
) -> float:
    """Distance from the drone's centre to the wall that the drone scans, m.

    `mount_offset_m` is the distance from the drone's centre to the sensor. `wander_m` is the drift
    of the autopilot's position estimate, one sigma.

    "range" is the paper's range adjustment: a distance close to the sensor's maximum, which covers
    most of the room with few passes. "accurate" is the distance with the smallest sigma in the
    sensor's noise model. A number is returned unchanged.
    """
    if not isinstance(wanted, str):
        return wanted
    margin_m = MARGIN_M + WANDER_SIGMAS * wander_m
    least_m = max(MIN_M - mount_offset_m, sensor.min_m + margin_m)
    steps = round((sensor.max_m - least_m) / STEP_M)
    distances_m = [least_m + STEP_M * step for step in range(steps)]
    if wanted == "accurate":
        return min(distances_m, key=sensor.sigma_m) + mount_offset_m
    seen = [
        m
        for m in distances_m
        if m + SURELY_SIGMAS * sensor.sigma_m(m) <= sensor.max_m
        and sensor.sigma_m(m) <= WORTH_SIGMA_M
    ]
    return max(seen, default=least_m) + mount_offset_m

"""How far from the wall: as far as the sensor reaches, where it is most exact, or as asked for."""

from companion.config.settings import Standoff
from companion.core.messages import RangeModel

STEP_M = 0.05
SURELY_SIGMAS = 3.0
"""A wall at the stand-off must still be in range when noise adds so much."""
WORTH_SIGMA_M = 0.10
"""Readings with more noise than this make no map."""
MIN_M, MARGIN_M = 0.8, 0.25
"""From any wall; and beyond the sensor's least distance, so that no gust leads there."""
WANDER_SIGMAS = 3.0
"""So far the drone may be carried by what the autopilot's estimate wanders, beside a gust."""


def standoff_m(
    wanted: Standoff, sensor: RangeModel, mount_offset_m: float, wander_m: float = 0.0
) -> float:
    """From the drone's centre to the wall that it scans.

    `wander_m` is how far the autopilot's estimate wanders, one sigma.

    "range" is the paper's range adjustment: close to the sensor's maximum, and with few flights the
    most of the room. "accurate" is where the noise model says that a reading is best.
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

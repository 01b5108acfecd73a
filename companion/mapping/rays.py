"""Converts range readings to rays of the occupancy grid, with and without a hit."""

import math
from collections.abc import Mapping

from companion.core.frames import wrap_rad
from companion.core.messages import (
    BEARING_FRD_RAD,
    Beam,
    Pose,
    RangeModel,
    RangeScan,
    RangeState,
    RangeUnit,
)
from companion.mapping.occupancy import Ray

SEES_SIGMA_M = 0.15
"""Largest noise at which the sensor reliably detects an obstacle, m. Chosen."""


def sees_to_m(sensor: RangeModel) -> float:
    """Distance up to which a reading of nothing in range frees space."""
    distance_m = sensor.max_m
    while sensor.sigma_m(distance_m) > SEES_SIGMA_M:
        distance_m -= 0.1
    return distance_m


def rays(pose: Pose, scan: RangeScan, units: Mapping[Beam, RangeUnit]) -> list[Ray]:
    """Rays of the horizontal beams. TOO_NEAR, STALE and FAILED give none."""
    found = []
    here = pose.ne_m
    for beam in BEARING_FRD_RAD:
        unit, reading = units.get(beam), scan.readings.get(beam)
        if unit is None or reading is None:
            continue
        bearing_rad = wrap_rad(pose.yaw_rad + unit.bearing_frd_rad)
        if reading.is_distance:
            end_m = reading.distance_m + unit.offset_m
            sigma_m = math.sqrt(reading.variance_m2)
            found.append(Ray(here, bearing_rad, end_m, sigma_m, True, pose.time_s))
        elif reading.state is RangeState.NOTHING:
            free_m = sees_to_m(unit.model) + unit.offset_m
            found.append(Ray(here, bearing_rad, free_m, 0.0, False, pose.time_s))
    return found

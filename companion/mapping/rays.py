"""From range readings to what they say of the space: rays that ended, or met nothing."""

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
"""Where the sensor's noise has grown to this, it may well have missed something."""


def sees_to_m(sensor: RangeModel) -> float:
    """As far as a reading of nothing in range is believed."""
    distance_m = sensor.max_m
    while sensor.sigma_m(distance_m) > SEES_SIGMA_M:
        distance_m -= 0.1
    return distance_m


def rays(pose: Pose, scan: RangeScan, units: Mapping[Beam, RangeUnit]) -> list[Ray]:
    """Of the horizontal beams; one that is too near, stale or failed says nothing."""
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

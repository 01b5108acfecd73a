"""Rays of the occupancy grid, from range readings with and without a hit."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array, Mask
from companion.core.frames import Vector2, wrap_rad
from companion.core.messages import (
    BEARING_FRD_RAD,
    Beam,
    Pose,
    RangeModel,
    RangeScan,
    RangeState,
    RangeUnit,
)

SEES_SIGMA_M = 0.15
"""Largest noise at which the sensor reliably detects an obstacle, m. Chosen."""


@dataclass(frozen=True, slots=True)
class Ray:
    """One reading from one position, local NED. `end_m` is measured from the drone's centre."""

    origin_ne_m: Vector2
    bearing_rad: float
    end_m: float
    sigma_m: float
    is_hit: bool
    """False: no return up to `end_m`."""
    time_s: float


@dataclass(frozen=True, slots=True)
class Rays:
    """Many readings, (r, 2) and (r,)."""

    origin_ne_m: Array
    bearing_rad: Array
    end_m: Array
    sigma_m: Array
    is_hit: Mask
    time_s: Array

    @classmethod
    def of(cls, rays: Sequence[Ray]) -> "Rays":
        return cls(
            np.array([ray.origin_ne_m for ray in rays]).reshape(-1, 2),
            np.array([ray.bearing_rad for ray in rays]),
            np.array([ray.end_m for ray in rays]),
            np.array([ray.sigma_m for ray in rays]),
            np.array([ray.is_hit for ray in rays], dtype=np.bool_),
            np.array([ray.time_s for ray in rays]),
        )


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

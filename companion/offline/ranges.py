"""Estimates limits and noise of the range sensors from the log itself."""

from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array
from companion.core.messages import BEARING_FRD_RAD, Beam, RangeUnit
from companion.offline.reading.log import Log
from companion.offline.reading.sensors import RangeConfig, RangeSensor, SensorsConfig

SATURATED_SHARE = 0.02
"""Least share of a sensor's readings at its largest value, see below. Chosen."""
SATURATED_READINGS = 5
"""A largest value that occurs this often is the sensor's code for nothing in range. Chosen."""
STRAIGHT_RAD = np.radians(6)
"""Largest turn between rows over which the range to a wall changes evenly, rad. Chosen."""
MAX_DT_S = 1.0
"""Rows with a longer interval are not used for the noise, s. Chosen."""
MIN_TRIPLES = 40
"""Least row triples to estimate the noise. Chosen."""
UNKNOWN_SIGMA_M = 0.05
"""Sigma if the noise cannot be estimated, m. Chosen."""
MIN_SIGMA_M = 0.01
"""Least constant sigma, m. Chosen."""
MAX_SIGMA_M = 0.15
"""Largest constant sigma, m. Chosen."""
MAD_TO_SIGMA = 1.4826
"""Median absolute deviation to sigma of a Gaussian."""


@dataclass(frozen=True, slots=True)
class HorizontalBeam:
    """One beam of a log: usable ranges and sensor model."""

    bearing_frd_rad: float
    offset_m: float
    sensor: RangeSensor
    range_m: Array
    """(n,): NaN without a usable range."""

    @property
    def unit(self) -> RangeUnit:
        return RangeUnit(self.sensor, self.bearing_frd_rad, self.offset_m)


def horizontal_beams(log: Log, sensors: SensorsConfig) -> dict[Beam, HorizontalBeam]:
    """The log's horizontal beams that have at least one distance."""
    usable = {
        beam: usable_ranges(log.ranges_m[beam], sensors.of(beam))
        for beam in BEARING_FRD_RAD
        if beam in log.ranges_m
    }
    usable = {beam: ranges for beam, ranges in usable.items() if np.isfinite(ranges).any()}
    noise = _noise(log, list(usable.values()))
    return {
        beam: HorizontalBeam(
            sensors.bearing_rad(beam),
            sensors.of(beam).offset_m or 0.0,
            _sensor(sensors.of(beam), noise, float(np.nanmax(ranges))),
            ranges,
        )
        for beam, ranges in usable.items()
    }


def usable_ranges(ranges_m: Array, config: RangeConfig) -> Array:
    """The ranges (n,) without those outside the sensor's limits."""
    usable = ranges_m.copy()
    if config.min_m is not None:
        usable[usable < config.min_m] = np.nan
    if config.max_m is not None:
        usable[usable > config.max_m] = np.nan
    known = usable[np.isfinite(usable)]
    if len(known):
        at_end = int((known == known.max()).sum())
        if at_end >= max(SATURATED_READINGS, SATURATED_SHARE * len(known)):
            usable[usable == known.max()] = np.nan
    return usable


def _sensor(config: RangeConfig, noise: tuple[float, float], largest_m: float) -> RangeSensor:
    known = config.sigma_m is not None or config.sigma_per_m2 is not None
    constant_m, per_m2 = (config.sigma_m or 0.0, config.sigma_per_m2 or 0.0) if known else noise
    max_m = config.max_m or largest_m
    return RangeSensor(min(config.min_m or 0.0, max_m), max_m, constant_m, per_m2)


def _noise(log: Log, ranges: list[Array]) -> tuple[float, float]:
    """Constant and quadratic part of sigma, by second differences of the ranges.

    While the drone moves evenly past straight walls the second difference of a range is only noise,
    of √6 sigmas. The median is robust against corners.
    """
    if len(log.time_s) < 3 or not ranges:
        return UNKNOWN_SIGMA_M, 0.0
    turned = np.abs(np.diff(log.odometry[:, 2]))
    even = (turned < STRAIGHT_RAD) & (np.diff(log.time_s) < MAX_DT_S)
    straight = even[1:] & even[:-1]
    uneven = np.concatenate([(r[2:] - 2 * r[1:-1] + r[:-2])[straight] for r in ranges])
    distance = np.concatenate([r[1:-1][straight] for r in ranges])
    known = np.isfinite(uneven)
    uneven, distance = np.abs(uneven[known]) / np.sqrt(6), distance[known]
    if len(uneven) < MIN_TRIPLES:
        return UNKNOWN_SIGMA_M, 0.0
    is_far = distance > np.median(distance)
    (near_m, near_sigma), (far_m, far_sigma) = (
        (float(np.median(distance[half])), MAD_TO_SIGMA * float(np.median(uneven[half])))
        for half in (~is_far, is_far if is_far.any() else ~is_far)
    )
    growth = (far_sigma**2 - near_sigma**2) / max(far_m**4 - near_m**4, 1e-6)
    per_m2 = float(np.sqrt(max(growth, 0.0)))
    constant_m = float(np.sqrt(max(near_sigma**2 - per_m2**2 * near_m**4, 0.0)))
    return float(np.clip(constant_m, MIN_SIGMA_M, MAX_SIGMA_M)), min(per_m2, 0.05)

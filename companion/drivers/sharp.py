"""Analogue infrared range sensors: from voltage to distance, with its variance, or why not.

`GP2Y0A710K0F` follows the points of its datasheet. `PAPER` is the sensor as the 2018 paper
describes it (2 cm to 5 m, an error of 5 cm at any distance), which no $20 part is.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from companion.messages import RangeReading, RangeState

DEAD_BELOW_V = 0.20
"""A powered sensor never reads this low: unplugged, or its supply is gone."""

NOTHING = RangeReading(RangeState.NOTHING)
TOO_NEAR = RangeReading(RangeState.TOO_NEAR)
FAILED = RangeReading(RangeState.FAILED)


class Profile(Protocol):
    """One kind of sensor."""

    min_m: float
    max_m: float

    def reading(self, volts: float) -> RangeReading:
        """What a voltage says."""
        ...

    def volts(self, distance_m: float | None) -> float:
        """What the sensor puts out before noise; None: nothing returns its light."""
        ...


def _interpolate(x: float, xs: Sequence[float], ys: Sequence[float]) -> tuple[float, float]:
    """Piecewise linear y and slope dy/dx at x; the end pieces go on beyond the ends."""
    i = min(max(bisect_right(xs, x) - 1, 0), len(xs) - 2)
    slope = (ys[i + 1] - ys[i]) / (xs[i + 1] - xs[i])
    return ys[i] + slope * (x - xs[i]), slope


@dataclass(frozen=True, slots=True)
class SharpProfile:
    """Triangulating sensor: voltage is nearly linear in 1/distance, and folds back when near.

    `far_points` are (distance m, V) over the specified range; `near_points` below it.
    """

    far_points: tuple[tuple[float, float], ...]
    near_points: tuple[tuple[float, float], ...]
    noise_v: float
    gain_sigma: float
    """What calibration leaves of the unit's gain error."""
    open_v: float = 1.25
    """Output when nothing returns."""
    broken_above_v: float = 3.4

    @property
    def min_m(self) -> float:
        return self.far_points[0][0]

    @property
    def max_m(self) -> float:
        return self.far_points[-1][0]

    def reading(self, volts: float) -> RangeReading:
        """Distance by the datasheet's curve, linear in 1/distance between its points."""
        if not DEAD_BELOW_V <= volts <= self.broken_above_v:
            return FAILED
        if volts > self.far_points[0][1]:
            return TOO_NEAR
        if volts < self.far_points[-1][1]:
            return NOTHING
        rising = tuple(reversed(self.far_points))
        inverse, slope = _interpolate(volts, [v for _, v in rising], [1 / d for d, _ in rising])
        distance_m = 1 / inverse
        sigma_m = self.noise_v * slope * distance_m**2
        variance = sigma_m**2 + (self.gain_sigma * distance_m) ** 2
        return RangeReading(RangeState.DISTANCE, distance_m, variance)

    def volts(self, distance_m: float | None) -> float:
        """The datasheet's curve; beyond its end it falls on towards the open output."""
        if distance_m is None:
            return self.open_v
        if distance_m < self.min_m:
            near = self.near_points
            return _interpolate(max(distance_m, 0.0), [d for d, _ in near], [v for _, v in near])[0]
        far = tuple(reversed(self.far_points))
        volts, _ = _interpolate(1 / distance_m, [1 / d for d, _ in far], [v for _, v in far])
        return max(volts, self.open_v)


@dataclass(frozen=True, slots=True)
class LinearProfile:
    """An ideal sensor: voltage linear in distance, the same error everywhere."""

    min_m: float
    max_m: float
    sigma_m: float
    zero_v: float = 0.3
    volts_per_m: float = 0.5
    open_v: float = 3.3

    def reading(self, volts: float) -> RangeReading:
        if volts < DEAD_BELOW_V:
            return FAILED
        distance_m = (volts - self.zero_v) / self.volts_per_m
        if distance_m > self.max_m:
            return NOTHING
        if distance_m < self.min_m:
            return TOO_NEAR
        return RangeReading(RangeState.DISTANCE, distance_m, self.sigma_m**2)

    def volts(self, distance_m: float | None) -> float:
        if distance_m is None or distance_m > self.max_m:
            return self.open_v
        return self.zero_v + self.volts_per_m * distance_m


GP2Y0A710K0F = SharpProfile(
    far_points=(
        *((1.0, 2.50), (1.2, 2.30), (1.4, 2.10), (1.6, 2.00), (1.8, 1.90), (2.0, 1.80)),
        *((2.3, 1.70), (2.6, 1.63), (2.9, 1.57), (3.2, 1.52), (3.5, 1.50), (3.8, 1.47)),
        *((4.1, 1.44), (4.4, 1.42), (4.7, 1.40), (5.0, 1.39), (5.5, 1.37)),
    ),
    near_points=(
        *((0.0, 1.2), (0.2, 1.45), (0.4, 2.3), (0.5, 3.13), (0.6, 3.08), (0.7, 3.00)),
        *((0.8, 2.80), (0.9, 2.60), (1.0, 2.50)),
    ),
    noise_v=0.010,
    gain_sigma=0.003,
)
PAPER = LinearProfile(min_m=0.02, max_m=5.0, sigma_m=0.05)
PROFILES: dict[str, Profile] = {"gp2y0a710k0f": GP2Y0A710K0F, "paper": PAPER}

"""Analogue infrared range sensors: converts voltage to distance and variance, or to a state.

`GP2Y0A710K0F` follows the points of its datasheet. `PAPER` is the sensor as described by the 2018
paper (2 cm to 5 m, an error of 5 cm at any distance); no $20 part is like that.
"""

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import Protocol

from companion.core.messages import RangeModel, RangeReading, RangeState
from companion.drivers.readings import FAILED, NOTHING, TOO_NEAR


class Profile(RangeModel, Protocol):
    """One type of sensor."""

    @property
    def noise_v(self) -> float:
        """Sigma of the output, V."""
        ...

    def reading(self, volts: float) -> RangeReading:
        """Reading of a voltage."""
        ...

    def volts(self, distance_m: float | None) -> float:
        """Output before noise; None: no return."""
        ...


@dataclass(frozen=True, slots=True)
class Curve:
    """Piecewise linear y over ascending x, extrapolated by the end pieces."""

    x: tuple[float, ...]
    y: tuple[float, ...]

    def at(self, x: float) -> tuple[float, float]:
        """Y and the slope dy/dx."""
        i = bisect_right(self.x, x, 1, len(self.x) - 1) - 1
        slope = (self.y[i + 1] - self.y[i]) / (self.x[i + 1] - self.x[i])
        return self.y[i] + slope * (x - self.x[i]), slope

    def inverse(self) -> "Curve":
        """X over y, for a rising curve."""
        return Curve(self.y, self.x)


@dataclass(frozen=True, slots=True)
class SharpProfile:
    """Triangulating sensor: voltage is nearly linear in 1/distance and aliases at short range.

    Below its minimum distance the voltage falls again, so a near obstacle reads like a distant one.
    """

    volts_by_inverse_m: Curve
    """Curve over the specified range."""
    inverse_m_by_volts: Curve
    volts_by_near_m: Curve
    """Curve below the specified range."""
    noise_v: float
    gain_sigma: float
    """Relative sigma of the gain error after calibration."""
    period_s: float
    """Interval of the measurements, s; the output holds the last one in between."""
    open_v: float
    """Output without a return, V."""
    least_v: float
    most_v: float
    """Output range of a working sensor, V; an open input or a short to a rail may be outside."""
    _rising: Curve = field(init=False, repr=False)
    _falling: Curve = field(init=False, repr=False)
    """Distances below the specified range by voltage, m: before and after the curve's peak."""

    def __post_init__(self) -> None:
        near = self.volts_by_near_m
        peak = max(range(len(near.y)), key=near.y.__getitem__)
        rising = Curve(near.y[: peak + 1], near.x[: peak + 1])
        falling = Curve(near.y[: peak - 1 : -1], near.x[: peak - 1 : -1])
        object.__setattr__(self, "_rising", rising)
        object.__setattr__(self, "_falling", falling)

    @property
    def min_m(self) -> float:
        return 1 / self.volts_by_inverse_m.x[-1]

    @property
    def max_m(self) -> float:
        return 1 / self.volts_by_inverse_m.x[0]

    @property
    def mean_age_s(self) -> float:
        return self.period_s / 2

    def reading(self, volts: float) -> RangeReading:
        """Distance by the datasheet's curve, linear in 1/distance between its points."""
        if not self.least_v <= volts <= self.most_v:
            return FAILED
        if volts > self.inverse_m_by_volts.x[-1]:
            return RangeReading(RangeState.TOO_NEAR, self._near_m(volts))
        if volts < self.inverse_m_by_volts.x[0]:
            return NOTHING
        inverse_m, inverse_m_per_volt = self.inverse_m_by_volts.at(volts)
        sigma_m = self._sigma_m(1 / inverse_m, inverse_m_per_volt)
        return RangeReading(RangeState.DISTANCE, 1 / inverse_m, sigma_m**2)

    def sigma_m(self, distance_m: float) -> float:
        _, volts_per_inverse_m = self.volts_by_inverse_m.at(1 / distance_m)
        return self._sigma_m(distance_m, 1 / volts_per_inverse_m)

    def _sigma_m(self, distance_m: float, inverse_m_per_volt: float) -> float:
        """Output noise times the curve's slope, d(1/d)/dV, plus the remaining gain error."""
        noise_m = self.noise_v * inverse_m_per_volt * distance_m**2
        return math.hypot(noise_m, self.gain_sigma * distance_m)

    def alias_m(self, distance_m: float) -> float | None:
        """Distance with the same output on the rising branch, from the lens to the curve's peak."""
        volts = self.volts(distance_m)
        return self._rising.at(volts)[0] if volts >= self._rising.x[0] else None

    def _near_m(self, volts: float) -> float:
        """Estimate of a distance that is too near, on the branch that falls from the peak."""
        nearest_m, farthest_m = self._falling.y[-1], self._falling.y[0]
        return min(max(self._falling.at(volts)[0], nearest_m), farthest_m)

    def volts(self, distance_m: float | None) -> float:
        """The datasheet's curve.

        Beyond its end it falls further, to the output without a return.
        """
        if distance_m is None:
            return self.open_v
        if distance_m < self.min_m:
            return self.volts_by_near_m.at(max(distance_m, 0.0))[0]
        return max(self.volts_by_inverse_m.at(1 / distance_m)[0], self.open_v)


@dataclass(frozen=True, slots=True)
class LinearProfile:
    """An ideal sensor: voltage linear in distance, the same error everywhere.

    Its zero is well above that of the wires, so an open input gives no valid distance.
    """

    min_m: float
    max_m: float
    error_m: float
    period_s: float
    gain_sigma: float = 0.0
    noise_v: float = 0.0
    """The output without a return has no noise."""
    zero_v: float = 1.2
    volts_per_m: float = 0.36
    open_v: float = 3.1

    @property
    def mean_age_s(self) -> float:
        return self.period_s / 2

    def reading(self, volts: float) -> RangeReading:
        if abs(volts - self.open_v) < OPEN_WITHIN_V:
            return NOTHING
        distance_m = (volts - self.zero_v) / self.volts_per_m
        if not -SIGMAS * self.error_m < distance_m < self.max_m + ADC_STEP_V / self.volts_per_m:
            return FAILED
        if distance_m < self.min_m:
            return TOO_NEAR
        return RangeReading(RangeState.DISTANCE, min(distance_m, self.max_m), self.error_m**2)

    def sigma_m(self, distance_m: float) -> float:
        return self.error_m

    def alias_m(self, distance_m: float) -> float | None:
        """No aliasing."""
        return None

    def volts(self, distance_m: float | None) -> float:
        if distance_m is None or distance_m > self.max_m:
            return self.open_v
        return self.zero_v + self.volts_per_m * distance_m


SIGMAS = 6.0
"""Noise never exceeds this many sigmas. Chosen."""
ADC_STEP_V = 0.005
"""Coarsest ADC step, V: ten bits of 5 V."""
OPEN_WITHIN_V = 0.04
"""The ideal sensor's output without a return has no noise, but a reference may be 1 % off, V.
Chosen."""
_GP2Y_POINTS = (
    *((5.5, 1.37), (5.0, 1.39), (4.7, 1.40), (4.4, 1.42), (4.1, 1.44), (3.8, 1.47)),
    *((3.5, 1.50), (3.2, 1.52), (2.9, 1.57), (2.6, 1.63), (2.3, 1.70), (2.0, 1.80)),
    *((1.8, 1.90), (1.6, 2.00), (1.4, 2.10), (1.2, 2.30), (1.0, 2.50)),
)
"""Distance, m, and output, V, from the datasheet's figure."""
_GP2Y_FAR = Curve(
    tuple(1 / metres for metres, _ in _GP2Y_POINTS), tuple(volts for _, volts in _GP2Y_POINTS)
)
"""Output, V, over the inverse of the distance, 1/m, from 1 m on."""
GP2Y0A710K0F = SharpProfile(
    volts_by_inverse_m=_GP2Y_FAR,
    inverse_m_by_volts=_GP2Y_FAR.inverse(),
    volts_by_near_m=Curve(
        (0.0, 0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0),
        (1.20, 1.45, 2.30, 3.13, 3.08, 3.00, 2.80, 2.60, 2.50),
    ),
    noise_v=0.010,
    gain_sigma=0.003,
    period_s=0.0165,
    open_v=1.25,
    least_v=1.25 - SIGMAS * 0.010,
    most_v=3.13 + SIGMAS * 0.010,
)
"""Sharp GP2Y0A710K0F. Curve from 0.5 m on and measuring period: datasheet. Other values: chosen."""
PAPER = LinearProfile(min_m=0.02, max_m=5.0, error_m=0.05, period_s=0.050)
"""Sensor of the 2018 paper: minimum and maximum distance and error, m. Period, s: chosen."""
PROFILES: dict[str, Profile] = {"gp2y0a710k0f": GP2Y0A710K0F, "paper": PAPER}

"""Models the Sharp infrared range sensor: its output voltage and when that changes.

The curve is that of the datasheet, stated here apart from the companion's driver, which inverts it.
"""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import itemgetter
from random import Random

TrueRange = Callable[[float], float | None]
"""time_s -> true distance along the beam, m; None without a surface."""


@dataclass(frozen=True, slots=True)
class SharpPhysics:
    """Deviation of a unit from its datasheet, and its noise."""

    output_v: Callable[[float | None], float]
    """Output before noise, V, at a distance, m; None: no return."""
    period_s: float
    """Mean refresh period of the units, s."""
    period_spread: float
    """Relative standard deviation of the units' refresh period."""
    gain_sigma: float
    """Standard deviation of the units' gain after calibration."""
    output_noise_v: float
    distance_noise_m: float
    max_return_m: float
    """Light from farther away does not return, m."""


Point = tuple[float, float]
"""Distance, m, and output, V."""
FAR_POINTS: tuple[Point, ...] = (
    *((5.5, 1.37), (5.0, 1.39), (4.7, 1.40), (4.4, 1.42), (4.1, 1.44), (3.8, 1.47)),
    *((3.5, 1.50), (3.2, 1.52), (2.9, 1.57), (2.6, 1.63), (2.3, 1.70), (2.0, 1.80)),
    *((1.8, 1.90), (1.6, 2.00), (1.4, 2.10), (1.2, 2.30), (1.0, 2.50)),
)
"""Output over the specified range, 1 to 5.5 m (GP2Y0A710K0F datasheet's figure)."""
NEAR_POINTS: tuple[Point, ...] = (
    *((0.0, 1.20), (0.2, 1.45), (0.4, 2.30)),
    *((0.5, 3.13), (0.6, 3.08), (0.7, 3.00), (0.8, 2.80), (0.9, 2.60), (1.0, 2.50)),
)
"""Output below the specified range. From 0.5 m: the datasheet's figure. Nearer: assumed by the
figure's shape."""
NO_RETURN_V = 1.25
"""Output without a return, V. Assumed. Beyond 5.5 m the curve falls to this value."""
OVER_INVERSE_M = tuple((1 / metres, volts) for metres, volts in FAR_POINTS)
"""Points of the far curve over 1/distance, in which a triangulating sensor is nearly linear."""


def gp2y0a710k0f_v(distance_m: float | None) -> float:
    """Output of the GP2Y0A710K0F before noise, V; None: no return."""
    if distance_m is None:
        return NO_RETURN_V
    if distance_m < FAR_POINTS[-1][0]:
        return _interpolated(NEAR_POINTS, max(distance_m, 0.0))
    return max(_interpolated(OVER_INVERSE_M, 1 / distance_m), NO_RETURN_V)


def _interpolated(points: Sequence[Point], x: float) -> float:
    """Piecewise linear y over ascending x, extrapolated by the end pieces."""
    end = bisect_right(points, x, 1, len(points) - 1, key=itemgetter(0))
    (x0, y0), (x1, y1) = points[end - 1], points[end]
    return y0 + (y1 - y0) / (x1 - x0) * (x - x0)


PAPER_MAX_M = 5.0
"""Range of the sensor that the paper describes, m (docs/sensors.md)."""
PAPER_ZERO_V, PAPER_V_PER_M, PAPER_NO_RETURN_V = 1.2, 0.36, 3.1
"""Output of that sensor at 0 m, V, its slope, V/m, and without a return, V. Chosen: an open input
reads lower (docs/sensors.md)."""


def paper_v(distance_m: float | None) -> float:
    """Output of the sensor that the paper describes, before noise, V; None: no return."""
    if distance_m is None or distance_m > PAPER_MAX_M:
        return PAPER_NO_RETURN_V
    return PAPER_ZERO_V + PAPER_V_PER_M * distance_m


PHYSICS = {
    "gp2y0a710k0f": SharpPhysics(gp2y0a710k0f_v, 0.0165, 0.05, 0.003, 0.010, 0.0, 8.0),
    "paper": SharpPhysics(paper_v, 0.050, 0.02, 0.0, 0.0, 0.05, 5.0),
}
"""Physics by profile; sources are in docs/sensors.md."""

USUAL_MEMORY = 0.1
"""Share of the ADC's previous conversion that remains at an open input. Assumed."""


class SharpUnit:
    """One sensor. It refreshes at its own clock and holds its output in between."""

    def __init__(self, physics: SharpPhysics, true_range: TrueRange, random: Random) -> None:
        self._physics = physics
        self.true_range = true_range
        self._random = random
        self._period_s = physics.period_s * (1 + random.gauss(0, physics.period_spread))
        self._phase_s = random.uniform(0, self._period_s)
        self.gain = 1 + random.gauss(0, physics.gain_sigma)
        self._refresh = -1
        self._volts = 0.0
        self.is_unplugged = self.is_stuck = False
        self.noise_factor = 1.0
        """Faults for tests."""
        self.memory = USUAL_MEMORY
        self.open_input_v: Callable[[float], float] = lambda memory: 0.0
        """Voltage at the ADC's open input as a function of its memory; set by the ADC."""

    def volts(self, time_s: float) -> float:
        """Voltage at the ADC's input, V. Computed on demand."""
        if self.is_unplugged:
            return self.open_input_v(self.memory)
        if self.is_stuck:
            return self._volts
        refresh = int((time_s + self._phase_s) / self._period_s)
        if refresh != self._refresh:
            self._refresh = refresh
            self._volts = self._measure(refresh * self._period_s - self._phase_s)
        return self._volts

    def _measure(self, time_s: float) -> float:
        physics, noise_factor = self._physics, self.noise_factor
        distance_m = self.true_range(time_s)
        if distance_m is not None:
            noise_m = noise_factor * self._random.gauss(0, physics.distance_noise_m)
            distance_m = distance_m * self.gain + noise_m
            distance_m = distance_m if distance_m <= physics.max_return_m else None
        noise_v = noise_factor * self._random.gauss(0, physics.output_noise_v)
        return physics.output_v(distance_m) + noise_v

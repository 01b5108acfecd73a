"""Models the Sharp infrared range sensor: its output voltage and when that changes."""

from collections.abc import Callable
from dataclasses import dataclass
from random import Random

from companion.drivers.chips.sharp import GP2Y0A710K0F, PAPER, Profile

TrueRange = Callable[[float], float | None]
"""time_s -> true distance along the beam, m; None without a surface."""


@dataclass(frozen=True, slots=True)
class SharpPhysics:
    """Deviation of a unit from its datasheet, and its noise."""

    profile: Profile
    period_s: float
    period_spread: float
    """Relative standard deviation of the units' refresh period."""
    gain_sigma: float
    """Standard deviation of the units' gain after calibration."""
    output_noise_v: float
    distance_noise_m: float
    max_return_m: float
    """Light from farther away does not return, m."""


PHYSICS = {
    "gp2y0a710k0f": SharpPhysics(GP2Y0A710K0F, 0.0165, 0.05, 0.003, 0.010, 0.0, 8.0),
    "paper": SharpPhysics(PAPER, 0.050, 0.02, 0.0, 0.0, 0.05, 5.0),
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
        return physics.profile.volts(distance_m) + noise_v

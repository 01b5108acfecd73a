"""The infrared range sensor's physics: what voltage stands at its output, and when it changes."""

from collections.abc import Callable
from dataclasses import dataclass
from random import Random

from companion.drivers.chips.sharp import GP2Y0A710K0F, PAPER, Profile

TrueRange = Callable[[float], float | None]
"""time_s -> true distance along the beam, m; None if nothing is there."""


@dataclass(frozen=True, slots=True)
class SharpPhysics:
    """How a unit differs from its datasheet, and how it is noisy."""

    profile: Profile
    period_s: float
    period_spread: float
    """Sigma of the units' refresh period, relative."""
    gain_sigma: float
    """Sigma of the units' gain after calibration."""
    output_noise_v: float
    distance_noise_m: float
    sees_to_m: float
    """Light from farther away does not return."""


PHYSICS = {
    "gp2y0a710k0f": SharpPhysics(GP2Y0A710K0F, 0.0165, 0.05, 0.003, 0.010, 0.0, 8.0),
    "paper": SharpPhysics(PAPER, 0.050, 0.02, 0.0, 0.0, 0.05, 5.0),
}

USUAL_MEMORY = 0.1
"""Share of the ADC's conversion before that an open input shows; assumed."""


class SharpUnit:
    """One sensor. It refreshes by its own clock and holds its output in between."""

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
        """What stands at the ADC's input without it, by its memory; the ADC knows."""

    def volts(self, time_s: float) -> float:
        """At the ADC's input at a time; evaluated only when somebody looks."""
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
        physics, times = self._physics, self.noise_factor
        distance_m = self.true_range(time_s)
        if distance_m is not None:
            noise_m = times * self._random.gauss(0, physics.distance_noise_m)
            distance_m = distance_m * self.gain + noise_m
            distance_m = distance_m if distance_m <= physics.sees_to_m else None
        noise_v = times * self._random.gauss(0, physics.output_noise_v)
        return physics.profile.volts(distance_m) + noise_v

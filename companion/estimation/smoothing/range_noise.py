"""Noise and mounting of the range units as tables, for many readings at once."""

from collections.abc import Mapping

import numpy as np

from companion.core.arrays import Array, Indices
from companion.core.messages import Beam, RangeUnit

BEAMS = tuple(Beam)
"""Order of the beams in all tables."""
MIN_SIGMA_M = 1e-3
"""Least sigma of a range, m. Chosen."""
MIN_STEP_M = 1e-9
"""Least table step, m, for a sensor that reported only one distance."""


class RangeUnits:
    """Noise of all units, without the gain errors.

    Distances are compared as signals ς(d) = ∫ dd / σ(d), whose noise is 1 at any distance. For a
    Sharp sensor the signal is its voltage over the voltage noise, which is Gaussian. Distances
    computed from the voltage have a skewed noise, and a robust weight would bias them short.

    `beam` is a unit's index in `BEAMS`, (n,) or (n, 1). Distances are from the sensor, (n,) or (n,
    w).
    """

    STEPS = 900
    """Table steps over the range of a sensor. Chosen."""

    def __init__(self, units: Mapping[Beam, RangeUnit], noise_factor: float = 1.0) -> None:
        self.units = units
        size = len(BEAMS)
        self.min_m, self.max_m, self.gain_sigma = np.zeros(size), np.ones(size), np.zeros(size)
        self.offset_m, self.bearing_frd_rad, self.age_s = (np.zeros(size) for _ in range(3))
        self._sigma_m = np.ones((size, self.STEPS + 1))
        for beam, unit in units.items():
            at, model = BEAMS.index(beam), unit.model
            self.min_m[at], self.max_m[at] = model.min_m, model.max_m
            self.gain_sigma[at], self.age_s[at] = model.gain_sigma, model.mean_age_s
            self.offset_m[at], self.bearing_frd_rad[at] = unit.offset_m, unit.bearing_frd_rad
            distance_m = np.linspace(model.min_m, model.max_m, self.STEPS + 1)
            total_m = np.array([model.sigma_m(float(d)) for d in distance_m])
            without_gain = np.sqrt(total_m**2 - (model.gain_sigma * distance_m) ** 2)
            self._sigma_m[at] = noise_factor * np.maximum(without_gain, MIN_SIGMA_M)
        self._step_m = np.maximum((self.max_m - self.min_m) / self.STEPS, MIN_STEP_M)
        inverse = 1 / self._sigma_m
        per_step = 0.5 * self._step_m[:, None] * (inverse[:, 1:] + inverse[:, :-1])
        self._signal = np.zeros_like(self._sigma_m)
        self._signal[:, 1:] = np.cumsum(per_step, axis=1)

    def noisier(self, factor: float) -> "RangeUnits":
        """The same units with their noise multiplied by `factor`."""
        return RangeUnits(self.units, factor)

    def sigma_m(self, beam: Indices, distance_m: Array) -> Array:
        """Sigma at a distance; outside the range the sigma at its end."""
        place = np.rint(self._place(beam, distance_m)).astype(np.int64)
        sigma: Array = self._sigma_m[beam, place]
        return sigma

    def signal(self, beam: Indices, distance_m: Array) -> Array:
        """The signal ς of the class's docstring."""
        place = self._place(beam, distance_m)
        low = np.minimum(place.astype(np.int64), self.STEPS - 1)
        before = self._signal[beam, low]
        signal: Array = before + (place - low) * (self._signal[beam, low + 1] - before)
        return signal

    def _place(self, beam: Indices, distance_m: Array) -> Array:
        """Fractional table index, faster than `np.interp`."""
        inside = np.clip(distance_m, self.min_m[beam], self.max_m[beam])
        place: Array = (inside - self.min_m[beam]) / self._step_m[beam]
        return place

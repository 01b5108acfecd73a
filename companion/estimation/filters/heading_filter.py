"""Estimates heading from a low-cost gyro, corrected by wall directions.

A linear Kalman filter over heading ψ, gyro bias b, gyro scale error s and the directions α_i of
the normals of all walls:

    ψ' = ψ + (1 - s)·G - b·dt,   G = ∫ω dt        b, s, α_i constant

G is known, so the scale enters linearly. A wall whose normal was measured at the bearing β in the
body frame, a turn G and a time τ ago, gives

    β = α_i - ψ + (1 - s)·G - b·τ

which is linear too. A wall observed again after a turn therefore measures the gyro's scale, one
observed again later its bias. All directions are relative to the first heading, ψ = 0 at the start.
`kalman.py` has the equations of both steps.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import wrap_rad
from companion.core.messages import GyroSample
from companion.core.values import value
from companion.estimation.filters.kalman import corrected, predicted

_YAW, _BIAS, _SCALE, _WALLS = 0, 1, 2, 3
"""Indices of the state."""
_UNKNOWN_SIGMA_RAD = 10.0
"""Prior sigma of a wall's direction, rad: no information."""


@dataclass(frozen=True, slots=True)
class GyroModel:
    """Noise of the gyro (LSM9DS1). Priors until an Allan analysis replaces them."""

    rate_noise_rad_s_sqrt_hz: float = math.radians(0.02)
    bias_sigma_rad_s: float = math.radians(0.02)
    """Sigma of the bias after calibration at rest."""
    settling_sigma_rad_s: float = math.radians(0.1)
    """Sigma and time constant of the bias change after take-off by warm-up and vibration."""
    settling_s: float = 8.0
    bias_walk_rad_s_sqrt_s: float = math.radians(0.008)
    """Random walk of the bias in flight."""
    scale_sigma: float = 0.02

    def turn_sigma_rad(self, dt_s: Array, gap_rad2: Array | None) -> Array:
        """(k,): sigma of the turn in each interval `dt_s` with gyro gaps of variance `gap_rad2`."""
        sigma: Array = self.rate_noise_rad_s_sqrt_hz * np.sqrt(dt_s)
        return sigma if gap_rad2 is None else np.sqrt(sigma**2 + gap_rad2)

    def bias_variance_per_s(self, age_s: Array) -> Array:
        """Rate of the bias variance at `age_s` after the calibration, (rad/s)²/s.

        The settling part integrates to its variance: ∫ 2σ²/τ exp(-2t/τ) dt = σ².
        """
        settling = 2 / self.settling_s * self.settling_variance(age_s)
        variance: Array = settling + self.bias_walk_rad_s_sqrt_s**2
        return variance

    def settling_variance(self, age_s: Array) -> Array:
        """Variance that settling still adds after `age_s`, (rad/s)²."""
        fading = np.exp(-2 * np.asarray(age_s) / self.settling_s)
        variance: Array = self.settling_sigma_rad_s**2 * fading
        return variance


@value
class WallBearing:
    """A measured bearing of a wall's normal in the body frame, `age_s` ago.

    Since then the gyro has turned by `turned_rad`, uncorrected.
    """

    bearing_frd_rad: float
    sigma_rad: float
    turned_rad: float
    age_s: float


class HeadingFilter:
    """Heading relative to the first heading, clockwise positive, and the walls' directions."""

    GATE_SIGMAS = 4.0
    """Innovations beyond this many sigmas are rejected. Chosen."""

    def __init__(self, rest_bias_rad_s: float, model: GyroModel = GyroModel()) -> None:
        self._model = model
        self._last_s: float | None = None
        self._age_s = 0.0
        self.restart(
            np.array([0.0, rest_bias_rad_s, 0.0]),
            np.diag([0.0, model.bias_sigma_rad_s**2, model.scale_sigma**2]),
        )

    def restart(self, state: Array, covariance: Array) -> None:
        """Restart from heading, bias, scale and wall directions (n,) with covariance (n, n)."""
        self._f, self._q = np.eye(len(state)), np.zeros((len(state), len(state)))
        self._set(state, covariance)

    def _set(self, x: Array, p: Array) -> None:
        self._x, self._p = x, p
        # as plain floats, for reads many times a tick
        self._values: list[float] = x.tolist()

    def _sigma(self, index: int) -> float:
        return math.sqrt(self._p.item(index, index))

    @property
    def yaw_rad(self) -> float:
        return wrap_rad(self._values[_YAW])

    @property
    def yaw_sigma_rad(self) -> float:
        return self._sigma(_YAW)

    @property
    def bias_rad_s(self) -> float:
        return self._values[_BIAS]

    @property
    def scale_error(self) -> float:
        return self._values[_SCALE]

    def normal_rad(self, wall: int) -> float:
        """Direction of a wall's normal, from the drone to the wall, local NED."""
        return wrap_rad(self._values[_WALLS + wall])

    def facing(self, bearing_rad: float, most_rad: float) -> list[int]:
        """Walls that a beam at a bearing, local NED, meets at no larger incidence than `most_rad`.

        A wall is met from its front alone, where its normal leads away from the drone.
        """
        incidence_cos = np.cos(bearing_rad - self._x[_WALLS:])
        walls: list[int] = np.flatnonzero(incidence_cos >= math.cos(most_rad)).tolist()
        return walls

    def normal_sigma_rad(self, wall: int) -> float:
        return self._sigma(_WALLS + wall)

    def relative_sigma_rad(self, wall: int) -> float:
        """Sigma of the angle between the heading and a wall's normal."""
        at, covariance = _WALLS + wall, self._p.item
        variance = covariance(at, at) + covariance(_YAW, _YAW) - 2 * covariance(at, _YAW)
        return math.sqrt(max(variance, 0.0))

    def predict(self, samples: Sequence[GyroSample]) -> tuple[float, float]:
        """Integrate the samples since the last call.

        Returns the change of heading, corrected for bias and scale, and the uncorrected turn; rad.
        """
        turned_rad, duration_s, variance_rad2 = self._integrate(samples)
        self._age_s += duration_s
        return self.turn(turned_rad, duration_s, variance_rad2)

    def turn(
        self, turned_rad: float, duration_s: float, variance_rad2: float = 0.0
    ) -> tuple[float, float]:
        """Predict by an uncorrected gyro turn and the variance of its gaps.

        Returns as `predict`.
        """
        if duration_s <= 0:
            return 0.0, 0.0
        f, q, model = self._f, self._q, self._model
        before = self._values[_YAW]
        f[_YAW, _BIAS] = -duration_s
        f[_YAW, _SCALE] = -turned_rad
        q[_YAW, _YAW] = model.rate_noise_rad_s_sqrt_hz**2 * duration_s + variance_rad2
        q[_BIAS, _BIAS] = model.bias_variance_per_s(np.array(self._age_s)) * duration_s
        turned = self._x.copy()
        turned[_YAW] += turned_rad
        self._set(*predicted(turned, self._p, f, q))
        return self._values[_YAW] - before, turned_rad

    def _integrate(self, samples: Sequence[GyroSample]) -> tuple[float, float, float]:
        turned_rad = duration_s = variance_rad2 = 0.0
        for sample in samples:
            if self._last_s is not None and sample.time_s > self._last_s:
                dt_s = sample.time_s - self._last_s
                turned_rad += sample.yaw_rate_rad_s * dt_s
                duration_s += dt_s
                variance_rad2 += sample.turn_variance_rad2
            self._last_s = sample.time_s
        return turned_rad, duration_s, variance_rad2

    def add_wall(self, observed: WallBearing) -> int:
        """Add a wall; returns its number."""
        size = len(self._x)
        covariance = np.zeros((size + 1, size + 1))
        covariance[:size, :size] = self._p
        covariance[size, size] = _UNKNOWN_SIGMA_RAD**2
        direction = observed.bearing_frd_rad - observed.turned_rad + self._values[_YAW]
        self.restart(np.append(self._x, direction), covariance)
        wall = size - _WALLS
        self.correct_by_wall(wall, observed)
        return wall

    def correct_by_wall(self, wall: int, observed: WallBearing) -> bool:
        """Correct by a known wall's bearing; False if the gate rejects it."""
        innovation_rad, _ = self.innovation(wall, observed)
        return self._correct(self._gradient(wall, observed), innovation_rad, observed.sigma_rad)

    def innovation(self, wall: int, observed: WallBearing) -> tuple[float, float]:
        """Innovation of a wall's bearing and its sigma, rad."""
        h = self._gradient(wall, observed)
        expected = float(h @ self._x) + observed.turned_rad
        spread = math.sqrt(float(h @ self._p @ h) + observed.sigma_rad**2)
        return wrap_rad(observed.bearing_frd_rad - expected), spread

    def _gradient(self, wall: int, observed: WallBearing) -> Array:
        h = self._difference(_WALLS + wall, _YAW)
        h[_BIAS], h[_SCALE] = -observed.age_s, -observed.turned_rad
        return h

    def align_to_right_angle(self, wall: int, other: int, sigma_rad: float) -> bool:
        """Constrain the angle between two walls to a multiple of 90°, with sigma `sigma_rad`."""
        h = self._difference(_WALLS + wall, _WALLS + other)
        angle = float(h @ self._x)
        quarter = math.pi / 2
        return self._correct(h, round(angle / quarter) * quarter - angle, sigma_rad)

    def _difference(self, first: int, second: int) -> Array:
        h = np.zeros(len(self._x))
        h[first], h[second] = 1.0, -1.0
        return h

    def _correct(self, h: Array, innovation: float, sigma: float) -> bool:
        spread = math.sqrt(float(h @ self._p @ h) + sigma**2)
        if abs(innovation) > self.GATE_SIGMAS * spread:
            return False
        measured = float(h @ self._x) + innovation
        self._set(*corrected(self._x, self._p, h, measured, sigma**2))
        return True

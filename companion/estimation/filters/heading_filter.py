"""Heading from a cheap gyro, put right by the direction of walls.

A linear Kalman filter over heading ψ, gyro bias b, gyro scale error s and the directions α_i of
the normals of all walls seen so far:

    ψ' = ψ + (1 - s)·G - b·dt,   G = ∫ω dt        b, s, α_i constant

G is known, so the scale enters linearly. A wall whose normal was seen at the angle β off the nose,
a turn G and a time τ ago, tells

    β = α_i - ψ + (1 - s)·G - b·τ

which is linear too. A wall seen again after a turn therefore measures the gyro's scale, one seen
again later its bias, and all walls keep their place relative to the first heading, ψ = 0 at the
start. Prediction and correction are filterpy's; it updates the covariance in Joseph form.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray

from companion.core.frames import wrap_rad
from companion.core.messages import GyroSample
from companion.core.values import value

Array = NDArray[np.float64]

_YAW, _BIAS, _SCALE, _WALLS = 0, 1, 2, 3
_UNKNOWN_SIGMA_RAD = 10.0
"""Prior of a wall's direction: none to speak of."""


@dataclass(frozen=True, slots=True)
class GyroModel:
    """How far the gyro may be trusted (LSM9DS1; priors until an Allan analysis replaces them)."""

    rate_noise_rad_s_sqrt_hz: float = math.radians(0.02)
    bias_sigma_rad_s: float = math.radians(0.02)
    """What calibration at rest leaves."""
    settling_sigma_rad_s: float = math.radians(0.1)
    """What take-off adds, by warming up and vibration, and how quickly."""
    settling_s: float = 8.0
    bias_walk_rad_s_sqrt_s: float = math.radians(0.008)
    """And ever after."""
    scale_sigma: float = 0.02

    def turn_sigma_rad(self, dt_s: Array, gap_rad2: Array | None) -> Array:
        """(k,): of what was turned in each of these times, with gaps in them of that variance."""
        sigma: Array = self.rate_noise_rad_s_sqrt_hz * np.sqrt(dt_s)
        return sigma if gap_rad2 is None else np.sqrt(sigma**2 + gap_rad2)

    def bias_variance_per_s(self, age_s: Array) -> Array:
        """How quickly the bias wanders so long after the calibration, (rad/s)²/s.

        What settling adds comes to its sigma in the end: ∫ 2σ²/τ exp(-2t/τ) dt = σ².
        """
        settling = 2 / self.settling_s * self.settling_variance(age_s)
        variance: Array = settling + self.bias_walk_rad_s_sqrt_s**2
        return variance

    def settling_variance(self, age_s: Array) -> Array:
        """What settling still adds from then on, (rad/s)²."""
        fading = np.exp(-2 * np.asarray(age_s) / self.settling_s)
        variance: Array = self.settling_sigma_rad_s**2 * fading
        return variance


@value
class WallBearing:
    """A wall's normal, seen `bearing_frd_rad` off the nose some time ago.

    Since then the gyro has turned by `turned_rad`, uncorrected, in `age_s`.
    """

    bearing_frd_rad: float
    sigma_rad: float
    turned_rad: float
    age_s: float


class HeadingFilter:
    """Heading relative to the first heading, clockwise positive, and the walls' directions."""

    GATE_SIGMAS = 4.0

    def __init__(self, rest_bias_rad_s: float, model: GyroModel = GyroModel()) -> None:
        self._model = model
        self._last_s: float | None = None
        self._age_s = 0.0
        self._filter = self._grown(
            np.array([0.0, rest_bias_rad_s, 0.0]),
            np.diag([0.0, model.bias_sigma_rad_s**2, model.scale_sigma**2]),
        )
        self._note()

    @staticmethod
    def _grown(x: Array, p: Array) -> KalmanFilter:
        kalman = KalmanFilter(dim_x=len(x), dim_z=1)
        kalman.x, kalman.P = x.reshape(-1, 1), p
        kalman.F, kalman.Q = np.eye(len(x)), np.zeros((len(x), len(x)))
        return kalman

    def restart(self, state: Array, covariance: Array) -> None:
        """Go on from heading, bias, scale and all walls' directions (n,) as told, (n, n)."""
        self._filter = self._grown(state, covariance)
        self._note()

    def _note(self) -> None:
        """The state as plain floats, which are asked for many times a tick."""
        self._values: list[float] = self._filter.x[:, 0].tolist()

    def _sigma(self, index: int) -> float:
        return math.sqrt(self._filter.P.item(index, index))

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

    def normal_sigma_rad(self, wall: int) -> float:
        return self._sigma(_WALLS + wall)

    def relative_sigma_rad(self, wall: int) -> float:
        """Sigma of the angle between the nose and a wall's normal."""
        at, covariance = _WALLS + wall, self._filter.P.item
        variance = covariance(at, at) + covariance(_YAW, _YAW) - 2 * covariance(at, _YAW)
        return math.sqrt(max(variance, 0.0))

    def predict(self, samples: Sequence[GyroSample]) -> tuple[float, float]:
        """Integrate the samples since the last call.

        Returns how far the heading moved, corrected for bias and scale, and uncorrected; rad.
        """
        turned_rad, duration_s, variance_rad2 = self._integrate(samples)
        self._age_s += duration_s
        return self.turn(turned_rad, duration_s, variance_rad2)

    def turn(
        self, turned_rad: float, duration_s: float, variance_rad2: float = 0.0
    ) -> tuple[float, float]:
        """The same, for what the gyro has turned by, uncorrected, and the variance of its gaps."""
        if duration_s <= 0:
            return 0.0, 0.0
        kalman, model = self._filter, self._model
        before = self._values[_YAW]
        kalman.F[_YAW, _BIAS] = -duration_s
        kalman.F[_YAW, _SCALE] = -turned_rad
        kalman.x[_YAW, 0] += turned_rad
        kalman.Q[_YAW, _YAW] = model.rate_noise_rad_s_sqrt_hz**2 * duration_s + variance_rad2
        kalman.Q[_BIAS, _BIAS] = model.bias_variance_per_s(np.array(self._age_s)) * duration_s
        kalman.predict()
        self._note()
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

    def add_wall(self, seen: WallBearing) -> int:
        """A wall not seen before; its number."""
        size = len(self._filter.x)
        covariance = np.zeros((size + 1, size + 1))
        covariance[:size, :size] = self._filter.P
        covariance[size, size] = _UNKNOWN_SIGMA_RAD**2
        direction = seen.bearing_frd_rad - seen.turned_rad + self._values[_YAW]
        self._filter = self._grown(np.append(self._filter.x, direction), covariance)
        self._note()
        wall = size - _WALLS
        self.see_wall(wall, seen)
        return wall

    def see_wall(self, wall: int, seen: WallBearing) -> bool:
        """Correct by a wall seen again; False if that is not believable."""
        innovation_rad, _ = self.innovation(wall, seen)
        return self._correct(self._gradient(wall, seen), innovation_rad, seen.sigma_rad)

    def innovation(self, wall: int, seen: WallBearing) -> tuple[float, float]:
        """How far off its expected direction a wall is seen, and the sigma of that; rad."""
        h = self._gradient(wall, seen)
        expected = float(h @ self._filter.x[:, 0]) + seen.turned_rad
        spread = math.sqrt(float(h @ self._filter.P @ h) + seen.sigma_rad**2)
        return wrap_rad(seen.bearing_frd_rad - expected), spread

    def _gradient(self, wall: int, seen: WallBearing) -> Array:
        h = self._difference(_WALLS + wall, _YAW)
        h[_BIAS], h[_SCALE] = -seen.age_s, -seen.turned_rad
        return h

    def square_up(self, wall: int, other: int, sigma_rad: float) -> bool:
        """Let two walls be at a multiple of 90°, as far as `sigma_rad` says."""
        h = self._difference(_WALLS + wall, _WALLS + other)
        angle = float(h @ self._filter.x[:, 0])
        quarter = math.pi / 2
        return self._correct(h, round(angle / quarter) * quarter - angle, sigma_rad)

    def _difference(self, first: int, second: int) -> Array:
        h = np.zeros(len(self._filter.x))
        h[first], h[second] = 1.0, -1.0
        return h

    def _correct(self, h: Array, innovation: float, sigma: float) -> bool:
        kalman = self._filter
        spread = math.sqrt(float(h @ kalman.P @ h) + sigma**2)
        if abs(innovation) > self.GATE_SIGMAS * spread:
            return False
        measured = float(h @ kalman.x[:, 0]) + innovation
        kalman.update(np.array([[measured]]), R=np.array([[sigma**2]]), H=h.reshape(1, -1))
        self._note()
        return True

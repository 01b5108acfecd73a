"""Estimates the odometry's wander in flight, from ranges to known walls.

Beside a wall, the foot of the perpendicular from the origin of the dead-reckoned frame is constant.
Its motion within a second, less range noise and odometry walk, is the wander across that wall
(`odometry_model.py`):

    D = mean(c over the last 0.2 s) - mean(c over 0.2 s a second before),   c = hit · normal
    E[D²] = 2·σ_w²·(1 - exp(-1 s / τ)) + σ_walk²·1 s + 2·σ_range² / n
"""

import math
from collections import deque

from companion.core.frames import Vector2
from companion.estimation.smoothing.odometry_model import WANDER_S, OdometryModel

BASE_S = 1.0
"""Time between the two means, s: about the correlation time of an autopilot's position error.
Chosen."""
MEAN_HITS = 4
"""Hits in each mean: 0.2 s of one beam. Chosen."""
MEMORY = 100.0
"""Time constant of the average, in comparisons: about ten seconds with three beams. Chosen."""
MAX_STEP_M = 0.5
"""A larger change in a second is another wall, not an odometry error, m. Chosen."""
PER_WANDER = 2 * (1 - math.exp(-BASE_S / WANDER_S))
"""E[D²] / σ_w² of the wander alone."""


class OdometryNoise:
    """Estimator of one flight. It updates the model's `wander_m`, never below its initial value."""

    def __init__(self, model: OdometryModel) -> None:
        self._model = model
        self._least_m2 = model.wander_m**2
        self._wander_m2 = 0.0
        self._tracks: dict[int, _Track] = {}

    def add_hit(
        self, beam: int, wall: int | None, time_s: float, place: tuple[Vector2, float, float]
    ) -> None:
        """Process a hit of a beam.

        `place`: position in the dead-reckoned frame, direction of the wall's normal there, and
        variance of the range.
        """
        track = self._tracks.get(beam)
        if wall is None or track is None or track.wall != wall or track.is_stale(time_s):
            self._tracks.pop(beam, None)
            if wall is None:
                return
            track = self._tracks[beam] = _Track(wall, place[1])
        error_m2 = track.add(time_s, place)
        if error_m2 is not None:
            self._learn(error_m2 - self._model.step_variance_m2_per_s * BASE_S)

    def _learn(self, wandered_m2: float) -> None:
        self._wander_m2 += (wandered_m2 / PER_WANDER - self._wander_m2) / MEMORY
        self._model.wander_m = math.sqrt(max(self._wander_m2, self._least_m2))


class _Track:
    """Successive hits of one beam on one wall."""

    def __init__(self, wall: int, normal_rad: float) -> None:
        self.wall = wall
        self._normal = math.cos(normal_rad), math.sin(normal_rad)
        self._hits: deque[tuple[float, float, float]] = deque()
        """Time, distance along the normal, variance of the range."""

    def is_stale(self, time_s: float) -> bool:
        return bool(self._hits) and time_s - self._hits[-1][0] > BASE_S / 4

    def add(self, time_s: float, place: tuple[Vector2, float, float]) -> float | None:
        """Square of the odometry's error over `BASE_S` at this hit; None without enough hits."""
        (north_m, east_m), _, variance_m2 = place
        along_m = north_m * self._normal[0] + east_m * self._normal[1]
        hits = self._hits
        hits.append((time_s, along_m, variance_m2))
        while hits[0][0] < time_s - BASE_S - 0.25:
            hits.popleft()
        new = list(hits)[-MEAN_HITS:]
        old = list(hits)[:MEAN_HITS]
        if len(hits) < 2 * MEAN_HITS or new[-1][0] - old[-1][0] < 0.8 * BASE_S:
            return None
        step_m = (sum(h[1] for h in new) - sum(h[1] for h in old)) / MEAN_HITS
        noise_m2 = (sum(h[2] for h in new) + sum(h[2] for h in old)) / MEAN_HITS**2
        return step_m**2 - noise_m2 if abs(step_m) < MAX_STEP_M else None

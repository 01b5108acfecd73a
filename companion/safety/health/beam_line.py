"""Tests whether a level beam points in its nominal direction, by fitting a wall to its end points.

With the nominal direction, the end points of readings of a wall lie on a line, however the drone
moves and turns. With a wrong direction they do not. They would lie on a line if they were rotated
about the drone:

    right beam, taken for            end points,         end points,
    the front beam                   nominal             rotated
    ─────────────────── wall             │ │ │                 .
      ▲ ▲ ▲  detects                     │ │ │           ·····
      drone ►                            . . .           drone ►
                                     drone ►

The distance of an end point from the line is measured along the beam, as the sensor measures. So
end points that move with the drone, along the beam itself, lie on no wall.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from companion.core.arrays import Array
from companion.core.messages import BEARING_FRD_RAD, Beam, RangeReading

READINGS, MIN_READINGS = 40, 15
"""Maximum and minimum number of readings in a test; the maximum lasts up to three seconds, at 20
readings a second. Chosen: fewer readings on a line prove nothing."""
WAY_M = 0.4
"""Distance that the drone flies between two tests, m. Chosen: more than the error of odometry
meanwhile."""
EDGE_M, EDGE_SIGMAS = 0.25, 5.0
"""Minimum change between two readings at an edge: m, and in sigmas; the larger one counts.
Chosen."""
ODOMETRY_M = 0.03
"""Sigma of the drone's position within a second, m. Source: velocity errors of 0.1 to 0.25 m/s that
last for a second or two (docs/autopilot.md); the line fit absorbs most of them."""
INCIDENCES_RAD = np.radians(np.arange(-84, 85, 3))
"""Incidence angles of the walls that are tried, beside the best fit, rad. Chosen: sensors detect no
wall at larger angles."""
FITS_SIGMAS, MISSES_SIGMAS = 1.6, 3.0
"""Residual (root mean square, in sigmas) below which end points lie on a line, and above which they
do not. Measured in recorded flights: 0.4 to 1.2 for correct beams, more than 6 for beams that
pointed elsewhere."""
AGAINST, WITHIN_S = 2, 5.0
"""Number of failed tests, within this time, s, that shows a wrong direction. Chosen."""


@dataclass(frozen=True, slots=True)
class Stand:
    """Position and heading of the drone, in a frame that only odometry and gyro move."""

    ahead_m: float = 0.0
    right_m: float = 0.0
    yaw_rad: float = 0.0


class BeamLine:
    """Test of one beam."""

    def __init__(self, beam: Beam) -> None:
        self._bearing_rad = BEARING_FRD_RAD[beam]
        self._rows: deque[tuple[float, float, float, float, float]] = deque(maxlen=READINGS)
        """Position, heading, distance and its sigma of each reading."""
        self._judged_at_m = (0.0, 0.0)
        self._against_s: deque[float] = deque(maxlen=AGAINST)

    def is_off(self, now_s: float) -> bool:
        """Return True if the last tests, within `WITHIN_S`, fit another direction only."""
        return len(self._against_s) == AGAINST and now_s - self._against_s[0] < WITHIN_S

    def take(self, now_s: float, reading: RangeReading, stand: Stand) -> None:
        """Add one reading."""
        sigma_m = math.sqrt(reading.variance_m2)
        edge_m = max(EDGE_M, EDGE_SIGMAS * sigma_m)
        if not reading.is_distance or (
            self._rows and abs(reading.distance_m - self._rows[-1][3]) > edge_m
        ):
            self._rows.clear()
        if not reading.is_distance:
            return
        place = stand.ahead_m, stand.right_m
        self._rows.append((*place, stand.yaw_rad, reading.distance_m, sigma_m))
        if len(self._rows) == 1:
            self._judged_at_m = place
        if len(self._rows) >= MIN_READINGS and math.dist(place, self._judged_at_m) > WAY_M:
            self._judged_at_m = place
            self._judge(now_s)

    def _judge(self, now_s: float) -> None:
        own, *others = (
            _misfit_sigmas(np.array(self._rows), self._bearing_rad + quarter * math.pi / 2)
            for quarter in range(4)
        )
        if own > MISSES_SIGMAS and min(others) < FITS_SIGMAS:
            self._against_s.append(now_s)
        elif own < FITS_SIGMAS and min(others) > MISSES_SIGMAS:
            self._against_s.clear()


def _misfit_sigmas(rows: Array, bearing_rad: float) -> float:
    """Root mean square residual, in sigmas, of readings (n, 5) to the best fitting wall."""
    place, yaw_rad, distance_m, sigma_m = rows[:, :2], rows[:, 2], rows[:, 3], rows[:, 4]
    along = np.column_stack([np.cos(yaw_rad + bearing_rad), np.sin(yaw_rad + bearing_rad)])
    ends = place + distance_m[:, None] * along
    normals = _normals(along, ends)
    least_cos = math.cos(INCIDENCES_RAD[-1])
    incidence_cos = np.maximum(np.abs(along @ normals), least_cos)  # (n, w)
    weights = 1 / ((sigma_m**2 + ODOMETRY_M**2)[:, None] * incidence_cos**2)
    off_m = ends @ normals
    off_m -= (weights * off_m).sum(axis=0) / weights.sum(axis=0)
    return float(np.sqrt((weights * off_m**2).mean(axis=0).min()))


def _normals(along: Array, ends: Array) -> Array:
    """Normals (2, w) of the walls that are tried, for beams (n, 2) and their end points (n, 2)."""
    middle = along.mean(axis=0)
    normal_rad = math.atan2(middle[1], middle[0]) + INCIDENCES_RAD
    tried: Array = np.stack([np.cos(normal_rad), np.sin(normal_rad)])
    off = ends - ends.mean(axis=0)
    best = np.linalg.eigh(off.T @ off)[1][:, 0]
    if abs(best @ middle) < math.cos(INCIDENCES_RAD[-1]) * np.hypot(*middle):
        return tried
    return np.column_stack([tried, best])

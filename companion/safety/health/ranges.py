"""Detects range sensors that answer with invalid distances: stuck, noisy and unplugged ones."""

import math
from dataclasses import replace

from companion.core.frames import Vector3, ned_to_frd
from companion.core.messages import (
    BEARING_FRD_RAD,
    Beam,
    Odometry,
    RangeReading,
    RangeScan,
    RangeState,
)
from companion.safety.health.coupling import CouplingWatch
from companion.safety.health.scatter import Scatter

STUCK_S, STUCK_M, STUCK_RAD = 0.5, 0.2, math.radians(20)
"""A sensor is stuck if its reading does not change at all for the first, s, although the drone
moved along the beam by the second, m, or turned by the third, rad. Chosen."""
NUMB_SIGMAS, NUMB_WITHIN_S = 2.0, 5.0
"""A sensor may be numb if its distance stays in a band of so many sigmas; a test lasts up to this
time, s. Chosen."""
NUMB_M, NUMB_WAY_SIGMAS, NUMB_RAD, NUMB_ROUND_M = 0.6, 8.0, math.radians(60), 0.8
"""A sensor is numb if the drone moved along the beam during that test by the first, m, or by the
second, in sigmas; the larger one counts. It is also numb if the drone turned by the third, rad, and
moved less than the fourth, m. Chosen: along a round wall the distance is constant too, but the path
is longer."""
LOW_M = 0.5
"""Minimum height above the take-off point for the noise test, m. Below, a level beam meets the
floor when the drone tilts by 10°, as before lift-off. Its readings then jump from none to any
value."""
PAUSED_S = 0.2
"""Readings farther apart than this are not compared, s. Chosen: the drone has moved meanwhile."""
FAILED = RangeReading(RangeState.FAILED)
"""Reading in place of an invalid one."""
Travel = tuple[float, float, float, float]
"""Forward, right and down, m, and the turn, rad, each summed since the start."""


class RangeWatch:
    """Checks of all beams."""

    def __init__(self) -> None:
        self.is_alive = False
        """At least one sensor answered in the latest scan."""
        self.travel: Travel = (0.0, 0.0, 0.0, 0.0)
        self._odometry: Odometry | None = None
        self._is_low = False
        self._beams: dict[Beam, _BeamWatch] = {}
        self._coupling = CouplingWatch()

    def take(self, scan: RangeScan, odometry: Odometry | None, turned_rad: float) -> RangeScan:
        """Return the scan with invalid readings as FAILED."""
        self._move(odometry, turned_rad)
        self.is_alive = any(reading.is_alive for reading in scan.readings.values())
        self._coupling.take(scan)
        bad = [beam for beam in self._coupling.open if scan.readings[beam].is_alive]
        for beam, reading in scan.readings.items():
            watch = self._beams.get(beam) or self._beams.setdefault(beam, _BeamWatch(beam))
            if self._is_low:
                watch.rest()
            if watch.is_bad(scan.time_s, reading, self.travel):
                bad.append(beam)
        if not bad:
            return scan
        return replace(scan, readings={**scan.readings, **dict.fromkeys(bad, FAILED)})

    def _move(self, odometry: Odometry | None, turned_rad: float) -> None:
        forward_m, right_m, down_m, _ = self.travel
        if odometry is not None:
            if self._odometry is not None:
                north_m, east_m, sunk_m = _moved(self._odometry, odometry)
                ahead_m, aside_m = ned_to_frd(north_m, east_m, odometry.yaw_rad)
                forward_m, right_m, down_m = forward_m + ahead_m, right_m + aside_m, down_m + sunk_m
            self._odometry = odometry
            self._is_low = odometry.position_ned_m[2] > -LOW_M
        self.travel = forward_m, right_m, down_m, turned_rad


def _moved(last: Odometry, now: Odometry) -> Vector3:
    """Motion north, east, down, m: from the velocity, or from the positions after a pause."""
    dt_s = now.time_s - last.time_s
    if dt_s > PAUSED_S:
        x, y, z = (a - b for a, b in zip(now.position_ned_m, last.position_ned_m, strict=True))
        return x, y, z
    north_m_s, east_m_s, down_m_s = now.velocity_ned_m_s
    return north_m_s * dt_s, east_m_s * dt_s, down_m_s * dt_s


class _BeamWatch:
    """Checks of one beam."""

    def __init__(self, beam: Beam) -> None:
        bearing_rad = BEARING_FRD_RAD.get(beam)
        self._is_level = bearing_rad is not None
        self._axis_frd = (
            (0.0, 0.0, 1.0)
            if bearing_rad is None
            else (math.cos(bearing_rad), math.sin(bearing_rad), 0.0)
        )
        self._value = math.nan
        self._changed_s = 0.0
        self._changed_at: Travel = (0.0, 0.0, 0.0, 0.0)
        self._seen_s = -math.inf
        self._numb_since: tuple[float, Travel] | None = None
        self._numb_between_m = (math.inf, -math.inf)
        self._last_at: Travel = (0.0, 0.0, 0.0, 0.0)
        self._scatter = Scatter()

    def rest(self) -> None:
        """Exclude the next reading from the noise test."""
        self._scatter.pause()

    def is_bad(self, time_s: float, reading: RangeReading, travel: Travel) -> bool:
        if time_s - self._seen_s > PAUSED_S:
            self._scatter.pause()
        self._scatter.take(time_s, reading, self._aside_m(reading, travel))
        self._seen_s, self._last_at = time_s, travel
        if not reading.is_alive:
            self._value = math.nan
            return False
        is_numb = self._is_numb(time_s, reading, travel)
        return self._is_stuck(time_s, reading, travel) or is_numb or self._scatter.is_too_much

    def _is_stuck(self, time_s: float, reading: RangeReading, travel: Travel) -> bool:
        value = reading.distance_m if math.isnan(reading.raw) else reading.raw
        if value != self._value:  # true for NaN, which shows no stuck sensor
            self._value, self._changed_s, self._changed_at = value, time_s, travel
            return False
        if time_s - self._changed_s < STUCK_S:
            return False
        along_m, turned_rad, _ = self._moved(self._changed_at, travel)
        return along_m > STUCK_M or turned_rad > STUCK_RAD

    def _is_numb(self, time_s: float, reading: RangeReading, travel: Travel) -> bool:
        """Return True if the reading varies less than its noise, and not with the motion."""
        low_m, high_m = self._numb_between_m
        low_m, high_m = min(low_m, reading.distance_m), max(high_m, reading.distance_m)
        sigma_m = math.sqrt(reading.variance_m2)
        if self._numb_since is not None and high_m - low_m < NUMB_SIGMAS * sigma_m:
            self._numb_between_m = low_m, high_m
            began_s, began_at = self._numb_since
            along_m, turned_rad, level_m = self._moved(began_at, travel)
            is_turned = turned_rad > NUMB_RAD and level_m < NUMB_ROUND_M
            if is_turned or along_m > max(NUMB_M, NUMB_WAY_SIGMAS * sigma_m):
                return True
            if time_s - began_s < NUMB_WITHIN_S:
                return False
        self._numb_since = (time_s, travel) if reading.is_distance else None
        self._numb_between_m = reading.distance_m, reading.distance_m
        return False

    def _moved(self, then: Travel, now: Travel) -> tuple[float, float, float]:
        """Motion along the beam, m, turn if the beam is level, rad, and horizontal motion, m."""
        forward_m, right_m, down_m, turned_rad = (n - t for n, t in zip(now, then, strict=True))
        x, y, z = self._axis_frd
        along_m = forward_m * x + right_m * y + down_m * z
        turned_rad = turned_rad if self._is_level else 0.0
        return abs(along_m), abs(turned_rad), math.hypot(forward_m, right_m)

    def _aside_m(self, reading: RangeReading, travel: Travel) -> float:
        """Sideways motion of the beam's end since the last reading, m."""
        along_m, turned_rad, level_m = self._moved(self._last_at, travel)
        if not self._is_level:
            return level_m
        beside_m2 = max(0.0, level_m**2 - along_m**2)
        across_m = math.hypot(math.sqrt(beside_m2), travel[2] - self._last_at[2])
        return across_m + turned_rad * (reading.distance_m if reading.is_distance else 0.0)

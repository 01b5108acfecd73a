"""Removes jumps from the autopilot's odometry, so that it contains the drone's motion alone."""

import math
from dataclasses import replace

from companion.core.frames import frd_to_ned, wrap_rad
from companion.core.messages import Odometry

MAX_SPEED_M_S = 5.0
"""Odometry with a higher speed is dropped, m/s. Chosen."""
MAX_TURN_RAD_S = math.radians(250)
"""A faster change of the heading is a jump, rad/s. Chosen."""
JUMP_M, JUMP_M_S2 = 0.25, 1.5
"""Maximum difference between a step and the integrated velocity: the first, m, plus the second,
m/s², times the time squared. Chosen."""
MIN_TURN_STEP_RAD = math.radians(20)
"""A smaller change of the heading is no jump, rad. Chosen."""
FORGOTTEN_S = 4.0
"""After a silence of this length, s, the sum of heading corrections may have restarted, for example
because the companion was restarted. It is then counted from there. Chosen."""


class SteadyOdometry:
    """Removes jumps of the autopilot's estimate; later odometry continues from before the jump.

    Slow heading corrections ("pulls") and small steps remain. Position and velocity are in the
    frame of the heading in the same message, and that heading converts them to the body frame.
    """

    def __init__(self) -> None:
        self._last: Odometry | None = None
        self._given: Odometry | None = None
        self._turned_rad = 0.0
        """Sum of the removed heading jumps, negative, rad."""
        self._pulled_rad = 0.0
        """Sum of the jumps in `pulled_rad`, negative, rad; they are no heading corrections."""
        self._has_jumped = False

    def take(self, report: Odometry | None) -> Odometry | None:
        """Return the same motion without jumps; None for missing or implausible odometry."""
        if report is None or not _is_plausible(report):
            return None
        last, self._last = self._last, report
        if last is None or self._given is None:
            self._given = report
            return report
        step_m, turn_rad = _step(last, report), wrap_rad(report.yaw_rad - last.yaw_rad)
        dt_s = report.time_s - last.time_s
        moved = not _is_jump(step_m, last, report, dt_s)
        turned = abs(turn_rad) <= max(MAX_TURN_RAD_S * dt_s, MIN_TURN_STEP_RAD)
        is_anew = dt_s > FORGOTTEN_S and report.pulled_rad != last.pulled_rad
        if not moved or not turned or is_anew:
            self._has_jumped = True
        if not self._has_jumped:
            self._given = report
            return report
        if not turned:
            self._turned_rad = wrap_rad(self._turned_rad - turn_rad)
        if not turned or dt_s > FORGOTTEN_S:
            self._pulled_rad = wrap_rad(self._pulled_rad + last.pulled_rad - report.pulled_rad)
        self._given = self._moved(self._given, report, step_m if moved else (0.0, 0.0, 0.0))
        return self._given

    def _moved(
        self, given: Odometry, report: Odometry, step_m: tuple[float, float, float]
    ) -> Odometry:
        """Advance `given` by a step, converted to the frame from before the jumps."""
        north_m, east_m = frd_to_ned(step_m[0], step_m[1], self._turned_rad)
        x, y, z = given.position_ned_m
        north_m_s, east_m_s, down_m_s = report.velocity_ned_m_s
        return replace(
            report,
            position_ned_m=(x + north_m, y + east_m, z + step_m[2]),
            velocity_ned_m_s=(*frd_to_ned(north_m_s, east_m_s, self._turned_rad), down_m_s),
            yaw_rad=wrap_rad(report.yaw_rad + self._turned_rad),
            pulled_rad=wrap_rad(report.pulled_rad + self._pulled_rad),
        )


def _step(last: Odometry, report: Odometry) -> tuple[float, float, float]:
    (x, y, z), (last_x, last_y, last_z) = report.position_ned_m, last.position_ned_m
    return x - last_x, y - last_y, z - last_z


def _is_plausible(report: Odometry) -> bool:
    speed_m_s = math.hypot(*report.velocity_ned_m_s)
    is_finite = all(map(math.isfinite, (*report.position_ned_m, report.yaw_rad, report.pulled_rad)))
    return is_finite and speed_m_s <= MAX_SPEED_M_S  # false for NaN too


def _is_jump(
    step_m: tuple[float, float, float], last: Odometry, report: Odometry, dt_s: float
) -> bool:
    """Return True if the step differs from the mean velocity times the time."""
    velocities = zip(last.velocity_ned_m_s, report.velocity_ned_m_s, strict=True)
    off_m = (
        way - 0.5 * dt_s * (before + after)
        for way, (before, after) in zip(step_m, velocities, strict=True)
    )
    return math.hypot(*off_m) > JUMP_M + JUMP_M_S2 * dt_s**2

"""Odometry that never jumps: how the drone has moved, and nothing else."""

import math
from dataclasses import replace

from companion.core.frames import frd_to_ned, wrap_rad
from companion.core.messages import Odometry

MAX_SPEED_M_S = 5.0
MAX_TURN_RAD_S = math.radians(250)
JUMP_M, JUMP_M_S2 = 0.25, 1.5
"""A step may differ so much from what the velocity says, the second by the time squared."""
MIN_TURN_STEP_RAD = math.radians(20)
FORGOTTEN_S = 4.0
"""After a silence so long it may be told anew, by a companion that was started again: how far the
heading had been pulled is counted from there."""


class SteadyOdometry:
    """Takes the jumps of an autopilot's estimate out; what follows goes on from before them.

    A pull of its heading, or a small step, is left: position and velocity are told in the frame of
    the heading that is told with them, and turned to the body by it.
    """

    def __init__(self) -> None:
        self._last: Odometry | None = None
        self._given: Odometry | None = None
        self._turned_rad = 0.0
        """What all jumps of the heading come to,"""
        self._pulled_rad = 0.0
        """and what its pulls come to that are none."""
        self._has_jumped = False

    def take(self, told: Odometry | None) -> Odometry | None:
        """The same motion without jumps; None also for what no drone does."""
        if told is None or not _is_plausible(told):
            return None
        last, self._last = self._last, told
        if last is None or self._given is None:
            self._given = told
            return told
        step_m, turn_rad = _step(last, told), wrap_rad(told.yaw_rad - last.yaw_rad)
        dt_s = told.time_s - last.time_s
        moved = not _is_jump(step_m, last, told, dt_s)
        turned = abs(turn_rad) <= max(MAX_TURN_RAD_S * dt_s, MIN_TURN_STEP_RAD)
        is_anew = dt_s > FORGOTTEN_S and told.pulled_rad != last.pulled_rad
        if not moved or not turned or is_anew:
            self._has_jumped = True
        if not self._has_jumped:
            self._given = told
            return told
        if not turned:
            self._turned_rad = wrap_rad(self._turned_rad - turn_rad)
        if not turned or dt_s > FORGOTTEN_S:
            self._pulled_rad = wrap_rad(self._pulled_rad + last.pulled_rad - told.pulled_rad)
        self._given = self._moved(self._given, told, step_m if moved else (0.0, 0.0, 0.0))
        return self._given

    def _moved(
        self, given: Odometry, told: Odometry, step_m: tuple[float, float, float]
    ) -> Odometry:
        """On by a step, seen in the frame from before the jumps."""
        north_m, east_m = frd_to_ned(step_m[0], step_m[1], self._turned_rad)
        x, y, z = given.position_ned_m
        north_m_s, east_m_s, down_m_s = told.velocity_ned_m_s
        return replace(
            told,
            position_ned_m=(x + north_m, y + east_m, z + step_m[2]),
            velocity_ned_m_s=(*frd_to_ned(north_m_s, east_m_s, self._turned_rad), down_m_s),
            yaw_rad=wrap_rad(told.yaw_rad + self._turned_rad),
            pulled_rad=wrap_rad(told.pulled_rad + self._pulled_rad),
        )


def _step(last: Odometry, told: Odometry) -> tuple[float, float, float]:
    (x, y, z), (last_x, last_y, last_z) = told.position_ned_m, last.position_ned_m
    return x - last_x, y - last_y, z - last_z


def _is_plausible(told: Odometry) -> bool:
    speed_m_s = math.hypot(*told.velocity_ned_m_s)
    is_finite = all(map(math.isfinite, (*told.position_ned_m, told.yaw_rad)))
    return is_finite and speed_m_s <= MAX_SPEED_M_S  # false for NaN too


def _is_jump(
    step_m: tuple[float, float, float], last: Odometry, told: Odometry, dt_s: float
) -> bool:
    """The step is not what the velocities at its ends come to."""
    velocities = zip(last.velocity_ned_m_s, told.velocity_ned_m_s, strict=True)
    off_m = (
        way - 0.5 * dt_s * (before + after)
        for way, (before, after) in zip(step_m, velocities, strict=True)
    )
    return math.hypot(*off_m) > JUMP_M + JUMP_M_S2 * dt_s**2

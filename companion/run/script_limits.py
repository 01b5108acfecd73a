"""Checks the values that a script gives to a step."""

import math

from companion.config.settings import MissionConfig
from companion.core.messages import Setpoint
from companion.pdps.flight.fly_velocity import MIN_HEIGHT_M
from companion.pdps.flight.order import Target
from companion.safety import fence
from companion.safety.control_laws import MAX_CLIMB_M_S

MAX_HEIGHT_M = 10.0
"""Greatest height of an order, above the take-off point, m: the greatest of `mission.height_m`."""


def require_target(target: Target, timeout_s: float | None, plan: MissionConfig) -> None:
    """Refuse a target that the drone cannot fly to.

    Raises:
        ValueError: a value is out of its limits; the text names value and limits.
    """
    for name, metres in zip(("north_m", "east_m"), target.ne_m, strict=True):
        if not math.isfinite(metres):
            raise ValueError(f"{name} = {metres}: should be a number of metres")
    height_m, most_m = target.height_m, min(MAX_HEIGHT_M, fence.top_m(plan))
    if height_m is not None and not MIN_HEIGHT_M <= height_m <= most_m:
        limit = "" if plan.max_height_m is None else ", below mission.max_height_m"
        raise ValueError(f"height_m = {height_m}: should be {MIN_HEIGHT_M} to {most_m:g}{limit}")
    if (reach_m := fence.reach_m(plan)) < math.hypot(*target.ne_m):
        raise ValueError(
            f"north_m, east_m = {target.ne_m[0]}, {target.ne_m[1]}: should be within "
            f"{reach_m:g} m, inside mission.max_distance_m = {plan.max_distance_m}"
        )
    if target.yaw_rad is not None and not math.isfinite(target.yaw_rad):
        raise ValueError(f"yaw_rad = {target.yaw_rad}: should be a number of radians")
    _require_positive("timeout_s", timeout_s)


def require_velocity(velocity: Setpoint, seconds: float | None, plan: MissionConfig) -> None:
    """Refuse a velocity that the drone does not fly.

    Raises:
        ValueError: a value is out of its limits; the text names value, limit and its key.
    """
    level_m_s = math.hypot(velocity.forward_m_s, velocity.right_m_s)
    if not level_m_s <= plan.speed_m_s:
        raise ValueError(
            f"forward_m_s, right_m_s = {velocity.forward_m_s}, {velocity.right_m_s}: "
            f"together should be at most mission.speed_m_s = {plan.speed_m_s}"
        )
    if not abs(velocity.down_m_s) <= MAX_CLIMB_M_S:
        raise ValueError(
            f"down_m_s = {velocity.down_m_s}: should be {-MAX_CLIMB_M_S} to {MAX_CLIMB_M_S}"
        )
    turn_rad_s = math.radians(plan.turn_rate_deg_s)
    if not abs(velocity.yaw_rate_rad_s) <= turn_rad_s:
        raise ValueError(
            f"yaw_rate_rad_s = {velocity.yaw_rate_rad_s}: should be at most "
            f"mission.turn_rate_deg_s = {plan.turn_rate_deg_s}, which is {turn_rad_s:.2f} rad/s"
        )
    _require_positive("seconds", seconds)


def _require_positive(name: str, seconds: float | None) -> None:
    if seconds is not None and not 0 < seconds < math.inf:
        raise ValueError(f"{name} = {seconds}: should be a positive number of seconds")

"""The perpendicular distance (paper, section 3.2, figure 1): nearest wall in a 360° turn.

Seen from one spot, a wall at perpendicular distance d in direction β returns the range
r(θ) = d / cos(θ - β) to a beam along θ. Hence

    1/r = a·cos θ + b·sin θ,    a = cos β / d,    b = sin β / d

is linear in (a, b), and a least-squares fit over a few degrees of the turn gives both d and β far
better than the single smallest range, which noise picks.
"""

import math
from collections.abc import Sequence

import numpy as np

from companion.core.frames import wrap_rad
from companion.core.values import value

HALF_WINDOW_RAD = math.radians(20)
MIN_RETURNS = 8
STEP_RAD = math.radians(5)
MAX_OFF_CENTRE_RAD = math.radians(10)
"""The foot of the perpendicular must lie inside the window that was fitted."""


@value
class TurnReading:
    """One return of the turn: bearing in local NED, range from the drone's centre."""

    bearing_rad: float
    range_m: float
    sigma_m: float


@value
class Perpendicular:
    """Where the nearest wall is."""

    bearing_rad: float
    distance_m: float


def find_perpendicular(turn: Sequence[TurnReading]) -> Perpendicular | None:
    """The nearest wall that was swept square on; None if the turn met none.

    If no window holds the foot of a perpendicular (only corners or ends of walls were in range),
    the shortest return stands for it, as in the paper.
    """
    candidates = [
        wall
        for step in range(round(math.tau / STEP_RAD))
        if (wall := _fit(_window(turn, step * STEP_RAD), step * STEP_RAD)) is not None
    ]
    if candidates:
        return min(candidates, key=lambda wall: wall.distance_m)
    if turn:
        shortest = min(turn, key=lambda ray: ray.range_m)
        return Perpendicular(shortest.bearing_rad, shortest.range_m)
    return None


def _window(turn: Sequence[TurnReading], centre_rad: float) -> list[TurnReading]:
    return [ray for ray in turn if abs(wrap_rad(ray.bearing_rad - centre_rad)) < HALF_WINDOW_RAD]


def _fit(rays: list[TurnReading], centre_rad: float) -> Perpendicular | None:
    if len(rays) < MIN_RETURNS:
        return None
    bearing = np.array([ray.bearing_rad for ray in rays])
    range_m = np.array([ray.range_m for ray in rays])
    weight = range_m**2 / np.array([ray.sigma_m for ray in rays])  # 1/sigma of 1/r
    design = np.column_stack([np.cos(bearing), np.sin(bearing)])
    (a, b), *_ = np.linalg.lstsq(design * weight[:, None], weight / range_m, rcond=None)
    inverse = math.hypot(a, b)
    wall = Perpendicular(math.atan2(b, a), 1 / inverse) if inverse > 0 else None
    if wall is None or abs(wrap_rad(wall.bearing_rad - centre_rad)) > MAX_OFF_CENTRE_RAD:
        return None
    return wall


def free_distance(turn: Sequence[TurnReading], bearing_rad: float, seen_to_m: float) -> float:
    """How far the turn has shown free space around a bearing; 0 where it has seen nothing.

    `seen_to_m` caps the answer: nobody has looked farther.
    """
    nearest = [ray.range_m for ray in _window(turn, bearing_rad)]
    return min([seen_to_m, *nearest]) if nearest else 0.0

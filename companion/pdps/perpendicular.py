"""Finds the perpendicular to the nearest wall in a 360° turn (paper, section 3.2, figure 1).

From one place, a beam along θ measures a wall at perpendicular distance d and bearing β at the
range r(θ) = d / cos(θ - β). Hence

    1/r = a·cos θ + b·sin θ,    a = cos β / d,    b = sin β / d

is linear in (a, b). A least-squares fit over a sector of the turn gives d and β. Both are more
accurate than the single smallest range, which is biased by noise.
"""

import math
from collections.abc import Sequence

import numpy as np

from companion.core.frames import Vector2, ned_to_frd, wrap_rad
from companion.core.values import value

HALF_WINDOW_RAD = math.radians(20)
"""Half width of a fitted sector, rad. Chosen."""
MIN_RETURNS = 8
"""Minimum number of readings in a fit. Chosen."""
STEP_RAD = math.radians(5)
"""Spacing of the sectors, rad. Chosen."""
MAX_OFF_CENTRE_RAD = math.radians(10)
"""Maximum angle between the fitted perpendicular and the sector's centre, rad. Chosen: the foot of
the perpendicular must lie inside the fitted sector."""


@value
class TurnReading:
    """A range reading of the turn: bearing in local NED, range from the drone's centre, sigma."""

    bearing_rad: float
    range_m: float
    sigma_m: float


@value
class Perpendicular:
    """Bearing of the perpendicular to a wall, local NED, and distance along it."""

    bearing_rad: float
    distance_m: float


SAME_WALL_RAD = math.radians(25)
"""Two bearings of perpendiculars within this angle are of one wall, rad. Chosen: the error of two
headings in a team, before their maps are aligned."""


def find_perpendicular(
    turn: Sequence[TurnReading], other_ne_m: Vector2 | None = None
) -> Perpendicular | None:
    """Perpendicular to the nearest wall; None if the turn has no readings.

    With another drone at `other_ne_m` from this one, it is the wall that is nearest for both, and
    before which neither is in the way of the other, if there is one.

    If no sector contains the foot of a perpendicular (only corners or ends of walls are in range),
    the result is the shortest reading, as in the paper.
    """
    candidates = [
        wall
        for step in range(round(math.tau / STEP_RAD))
        if (wall := _fit(_window(turn, step * STEP_RAD), step * STEP_RAD)) is not None
    ]
    if candidates and other_ne_m is not None:
        return min(candidates, key=lambda wall: _for_both(wall, other_ne_m))
    if candidates:
        return min(candidates, key=lambda wall: wall.distance_m)
    if turn:
        shortest = min(turn, key=lambda ray: ray.range_m)
        return Perpendicular(shortest.bearing_rad, shortest.range_m)
    return None


def _for_both(wall: Perpendicular, other_ne_m: Vector2) -> tuple[bool, float]:
    """Order of the walls for two drones: the lowest is best."""
    ahead_m, aside_m = ned_to_frd(*other_ne_m, wall.bearing_rad)
    return abs(aside_m) < abs(ahead_m), max(wall.distance_m, wall.distance_m - ahead_m)


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
    """Free distance that the turn measured round a bearing, m; 0 without a reading there.

    The result is at most `seen_to_m`.
    """
    nearest = [ray.range_m for ray in _window(turn, bearing_rad)]
    return min([seen_to_m, *nearest]) if nearest else 0.0

"""Final velocity limiter: the drone can always stop at its clearance from recent obstacles.

Each obstacle point limits the speed towards it, so that the drone can stop before it despite its
lag. Within the clearance the limit is negative, and the drone gives way.

An obstacle nearer than the sensors' minimum range is not detected again, and the drone drifts
against it. The part of that drift beyond the least clearance is added to the clearance. So the
drone moves away. Among legs, where obstacles around the drone require opposite velocities, the
obstacle with the most certain position counts most.

A passage has obstacles on both sides of the course and none between. There the drone may come
nearer to both sides than elsewhere, but keeps to the middle. Recent obstacle points lead it to the
middle of a narrow passage, because the map's cells are too coarse. The drone may also be askew in a
passage, with an obstacle ahead on its course. It may then be as near to both sides, but not to the
obstacle ahead. Otherwise it would be caught between obstacles whose positions drift.

An undetected obstacle may stand where no beam has passed. So the drone flies only as fast as it can
stop before the first unswept cell in its path. It may still crawl there, except among legs: there
it waits until a beam has swept the path.

Obstacles from minutes ago are in the map alone. They limit the speed towards them as in a passage.
The drone does not give way to them, because the map may be wrong by decimetres.
"""

import math
from dataclasses import replace

import numpy as np

from companion.config.settings import MissionConfig
from companion.core.arrays import Array
from companion.core.frames import Vector2
from companion.core.messages import Setpoint
from companion.core.values import value
from companion.mapping.occupancy import CELL_M
from companion.safety.control_laws import BODY_RADIUS_M, BRAKING_M_S2, clamp
from companion.safety.drift import DRIFT_SIGMAS
from companion.safety.obstacle_memory import Surroundings

GIVE_WAY_GAIN_1_S = 0.8
"""Speed away from an obstacle per missing clearance, 1/s. Chosen."""
MAX_GIVE_WAY_M_S = 0.15
"""Maximum speed away from an obstacle, and to the middle of a passage, m/s. Chosen."""
MAX_GIVE_WAY_TO_DRONES_M_S = 0.5
"""Maximum speed away from a teammate, m/s. Chosen."""
PASSAGE_CLEARANCE_M = 0.14
"""Minimum clearance between the body and either side of a passage, m. Chosen."""
PASSAGE_SLACK_M = 0.02
"""Margin by which the limits of the two sides of a passage leave its middle free, m. Chosen."""
POINT_M = 0.04
"""Distance to which a surface extends around a point of it, m. Chosen."""
BESIDE_M = 0.25
"""Obstacles farther from the course than this are beside the drone, not ahead, m. Chosen."""
PASSAGE_FROM_M, PASSAGE_TO_M = -0.4, 0.8
"""Interval along the course in which obstacles form a passage, from the drone's centre, m.
Chosen."""
OPPOSITE_COS, ACROSS_COS = -0.8, 0.7
"""Cosines of the angle to the nearest obstacle. Below the first, an obstacle is on the opposite
side of the drone. Beyond the second, with either sign, it is on one of the two sides. Chosen."""
NARROW_M = 0.7
"""Maximum half-width of a narrow passage, m; the drone passes a wider one as planned. Chosen."""
CENTRING_GAIN_1_S = 1.2
"""Speed to the middle of a passage per offset, 1/s. Chosen."""
COURSE_M_S = 0.1
"""Below this speed the drone hovers and has no course, m/s. Chosen."""
STOPS_M_S2 = 1.0
"""Assumed deceleration before unswept space, m/s². Autopilots brake harder than this after their
lag: from 0.8 m/s they stop within 0.4 to 0.6 m (docs/autopilot.md). Unswept space is most likely
free."""
CRAWL_M_S = 0.2
"""Speed allowed into unswept space, m/s. Chosen: a swing of the nose sweeps the whole path before
the drone reaches it. The drone advances a third of a metre per swing."""
INEXACT_NEAR_M = 1.0
"""Within this distance of an inexact point the drone does not crawl into unswept space, m. Chosen:
the sensors' minimum range, below which a thin obstacle is not measured."""
AMONG_LEGS_M_S = 0.6
"""Maximum speed among legs, m/s. Faster, the drone detects more legs too late, and its mean speed
is no higher: `benchmarks/flight/legs.py`."""
FULL_ROUNDS, ROUNDS = 8, 40
"""Number of full projections, and of projections in all. Chosen."""
MIN_SPEED_M_S = 0.02
"""Below this speed the course is taken as straight ahead, m/s. Chosen."""


def clear_of_all_m(plan: MissionConfig) -> float:
    """Planned distance from the drone's centre to any obstacle, m; less in a doorway."""
    return BODY_RADIUS_M + plan.clearance_m


@value
class _Bounds:
    """Speed limits (n,), m/s, in directions (n, 2), body FRD."""

    towards: Array
    max_m_s: Array
    sigma_m: Array
    """(n,): sigma of the obstacle's position, m."""


def guarded(setpoint: Setpoint, around: Surroundings, clearance_m: float) -> Setpoint:
    """Return the safe velocity nearest to `setpoint`; `clearance_m` is from the body's hull."""
    points = around.points_frd_m
    wanted = np.array([setpoint.forward_m_s, setpoint.right_m_s])
    passage = _passage(points[~np.broadcast_to(around.is_vague, len(points))], wanted)
    bounds = (
        _by_points(around, clearance_m, passage),
        _by_recalled(around),
        _by_others(around),
        _by_edge(around),
    )
    towards = np.concatenate([each.towards for each in bounds])
    max_m_s = np.concatenate([each.max_m_s for each in bounds])
    sigma_m = np.concatenate([each.sigma_m for each in bounds])
    if not around.is_among_legs:
        sigma_m = np.ones_like(sigma_m)
    safe = _bounded(_to_the_middle(wanted, passage), towards, max_m_s, sigma_m)
    gives_way_m_s = max(0.0, -float(max_m_s.min(initial=0.0)))
    forward, right = _within_swept_space(safe, around, gives_way_m_s)
    return replace(setpoint, forward_m_s=forward, right_m_s=right)


def _within_swept_space(velocity: Vector2, around: Surroundings, gives_way_m_s: float) -> Vector2:
    """Limit the speed so that the drone stops before unswept space, or enters it at a crawl.

    Among legs and near an inexact point it enters only to give way to an obstacle, at no more than
    that speed: the obstacle is certain, and in unswept space there is most likely none.
    """
    speed_m_s = math.hypot(*velocity)
    may_crawl = not around.is_among_legs and not _is_inexact_point_near(around)
    min_m_s = CRAWL_M_S if may_crawl else gives_way_m_s
    max_m_s = AMONG_LEGS_M_S if around.is_among_legs else math.inf
    if speed_m_s <= min_m_s:
        return velocity
    forward_m_s, right_m_s = velocity
    left_m = around.lane(math.atan2(right_m_s, forward_m_s)).clear_m
    left_m -= around.lag_s * math.hypot(*around.velocity_frd_m_s)
    stops_m_s = math.sqrt(2 * STOPS_M_S2 * max(left_m, 0.0))
    max_m_s = min(max(min_m_s, stops_m_s), max_m_s)
    share = min(1.0, max_m_s / speed_m_s)
    return share * forward_m_s, share * right_m_s


def _is_inexact_point_near(around: Surroundings) -> bool:
    """Return True if a thin obstacle may stand near the drone: it was detected only from afar."""
    away_m = np.hypot(*around.points_frd_m.T)
    return bool((away_m[np.broadcast_to(around.is_vague, len(away_m))] < INEXACT_NEAR_M).any())


def _by_points(around: Surroundings, clearance_m: float, passage: "_Passage | None") -> _Bounds:
    """Speed limits of recent obstacles; negative where one is too near."""
    towards, away_m = _towards(around.points_frd_m)
    if not len(towards):
        return _Bounds(towards, away_m, away_m)
    drift_m = np.broadcast_to(around.drift_m, len(away_m))
    drifted_m = DRIFT_SIGMAS * drift_m
    planned_m = BODY_RADIUS_M + clearance_m + np.maximum(drifted_m - PASSAGE_CLEARANCE_M, 0.0)
    side_m = np.maximum(PASSAGE_CLEARANCE_M, drifted_m if around.is_among_legs else 0.0)
    least_m = np.minimum(planned_m, BODY_RADIUS_M + side_m)
    if passage:
        keep_off_m = _keep_off_m(passage.half_m, planned_m, least_m)
    else:
        keep_off_m = _keep_off_askew_m(towards, away_m, planned_m, least_m)
    left_m = away_m - POINT_M - keep_off_m - _stopping_m(towards, around)
    gives_way = np.maximum(GIVE_WAY_GAIN_1_S * left_m, -MAX_GIVE_WAY_M_S)
    max_m_s = np.where(left_m > 0, _stopping_speed_m_s(left_m), gives_way)
    return _Bounds(towards, max_m_s, POINT_M + drift_m)


def _by_recalled(around: Surroundings) -> _Bounds:
    """Speed limits of older obstacles from the map; never negative."""
    towards, away_m = _towards(around.recalled_frd_m)
    if not len(towards):
        return _Bounds(towards, away_m, away_m)
    keep_off_m = BODY_RADIUS_M + PASSAGE_CLEARANCE_M + 0.5 * CELL_M
    max_m_s = _stopping_speed_m_s(away_m - keep_off_m - _stopping_m(towards, around))
    return _Bounds(towards, max_m_s, np.full_like(away_m, CELL_M))


def _by_others(around: Surroundings) -> _Bounds:
    """Speed limits of teammates; negative where one is too near."""
    towards, away_m = _towards(around.others_frd_m)
    if not len(towards):
        return _Bounds(towards, away_m, away_m)
    left_m = away_m - around.others_keep_off_m - _stopping_m(towards, around)
    gives_way = np.maximum(GIVE_WAY_GAIN_1_S * left_m, -MAX_GIVE_WAY_TO_DRONES_M_S)
    max_m_s = np.where(left_m > 0, _stopping_speed_m_s(left_m), gives_way)
    return _Bounds(towards, max_m_s, np.full_like(away_m, POINT_M))


def _by_edge(around: Surroundings) -> _Bounds:
    """Speed limit of the fence; negative outside it."""
    if math.isinf(around.edge_m):
        return _Bounds(np.empty((0, 2)), np.empty(0), np.empty(0))
    towards = np.array([around.edge_frd])
    left_m = around.edge_m - _stopping_m(towards, around)
    gives_way = np.maximum(GIVE_WAY_GAIN_1_S * left_m, -MAX_GIVE_WAY_M_S)
    max_m_s = np.where(left_m > 0, _stopping_speed_m_s(left_m), gives_way)
    return _Bounds(towards, max_m_s, np.full(1, CELL_M))


def _towards(points: Array) -> tuple[Array, Array]:
    """Unit vectors (n, 2) to points, and their distances (n,), m."""
    away_m = np.maximum(np.hypot(points[:, 0], points[:, 1]), 1e-3)
    return points / away_m[:, None], away_m


def _stopping_m(towards: Array, around: Surroundings) -> Array:
    """(n,): distance that the drone covers towards each point before it brakes, m."""
    closing_m_s = towards @ np.array(around.velocity_frd_m_s)
    lag_m: Array = around.lag_s * np.maximum(closing_m_s, 0.0)
    return lag_m


def _stopping_speed_m_s(left_m: Array) -> Array:
    """(n,): highest speed, m/s, from which the drone stops within `left_m`."""
    fast_m_s: Array = np.sqrt(2 * BRAKING_M_S2 * np.maximum(left_m, 0.0))
    return fast_m_s


def _bounded(wanted: Array, towards: Array, max_m_s: Array, sigma_m: Array) -> Vector2:
    """Project the velocity repeatedly onto the most violated limit, relative to its sigma.

    If two limits contradict each other, the steps shrink until both are violated equally. So the
    drone moves to the middle of a gap that is too narrow. If it hovered, it would drift into a
    side. An obstacle of a minute ago demands the most clearance, but must not push the drone into
    one of a second ago.
    """
    velocity = wanted.copy()
    if not len(towards):
        return float(velocity[0]), float(velocity[1])
    for round_ in range(ROUNDS):
        over = towards @ velocity - max_m_s
        worst = int((over / sigma_m).argmax())
        if over[worst] <= 1e-6:
            break
        share = min(1.0, FULL_ROUNDS / (round_ + 1))
        velocity = velocity - share * over[worst] * towards[worst]
    return float(velocity[0]), float(velocity[1])


@value
class _Passage:
    """Distances from the drone's centre to the nearest obstacle on either side of the course."""

    left_m: float
    right_m: float

    @property
    def half_m(self) -> float:
        return 0.5 * (self.left_m + self.right_m)


def _passage(points: Array, course: Array) -> _Passage | None:
    """Return None if a side has no obstacle, or if there is one between the sides."""
    ahead = _direction(course)
    along_m, aside_m = points @ ahead, points @ np.array((-ahead[1], ahead[0]))
    abreast = (along_m > PASSAGE_FROM_M) & (along_m < PASSAGE_TO_M)
    if (abreast & (along_m > 0) & (np.abs(aside_m) <= BESIDE_M)).any():
        return None  # a wall ahead
    right_m = aside_m[abreast & (aside_m > BESIDE_M)]
    left_m = -aside_m[abreast & (aside_m < -BESIDE_M)]
    if not len(right_m) or not len(left_m):
        return None
    return _Passage(float(left_m.min()), float(right_m.min()))


def _direction(course: Array) -> Array:
    speed = float(np.hypot(*course))
    return np.array([1.0, 0.0]) if speed < MIN_SPEED_M_S else course / speed


def _to_the_middle(wanted: Array, passage: _Passage | None) -> Array:
    """Add the velocity that leads to the middle of a narrow passage."""
    if passage is None or passage.half_m > NARROW_M or np.hypot(*wanted) < COURSE_M_S:
        return wanted
    ahead = _direction(wanted)
    off_m = 0.5 * (passage.right_m - passage.left_m)
    trim_m_s = clamp(CENTRING_GAIN_1_S * off_m, MAX_GIVE_WAY_M_S)
    centred: Array = wanted + trim_m_s * np.array((-ahead[1], ahead[0]))
    return centred


def _keep_off_m(half_m: float, planned_m: Array, least_m: Array) -> Array:
    """(n,): clearance from the drone's centre in a passage, m: as planned, or less."""
    room_m = half_m - POINT_M - PASSAGE_SLACK_M
    keep_off_m: Array = np.maximum(np.minimum(planned_m, room_m), least_m)
    return keep_off_m


def _keep_off_askew_m(towards: Array, away_m: Array, planned_m: Array, least_m: Array) -> Array:
    """(n,): clearance from the drone's centre, m; reduced for obstacles on two opposite sides.

    The course has no influence.
    """
    cos_across = towards @ towards[away_m.argmin()]
    opposite_m = float(away_m[cos_across < OPPOSITE_COS].min(initial=np.inf))
    half_m = 0.5 * (float(away_m.min()) + opposite_m)
    is_across = np.abs(cos_across) > ACROSS_COS
    return np.where(is_across, _keep_off_m(half_m, planned_m, least_m), planned_m)

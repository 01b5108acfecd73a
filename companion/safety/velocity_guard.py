"""The last word on every velocity: nothing that was met near the drone is come too close to.

Each point near the drone bounds the speed towards it, so that the drone can stop before it, with
its lag; nearer than it may be, the bound is below zero and the drone gives way.

What is nearer than the sensors measure is not met again, and the drone drifts against it. The bound
moves out with that, as far as the least clearance does not cover it, so that the drone moves away.

In a passage, with something on both sides of where it moves and nothing between, the drone may come
nearer to both than elsewhere, but to neither nearer than to the other. It is led to the middle of a
narrow one by what was met a moment ago: the map's cells are too coarse for that. Askew in one, with
something ahead on its course, it may be as near to what is on both sides of it, but not to what is
ahead: it would be held fast between them, and what it knows of them drifts.

What no beam has met may stand there all the same, if no beam has gone there. So the drone is no
faster than it stops before the first place, as wide as it is, that beams have not gone through. But
for a crawl, unless it is among legs: there it stands until a beam has gone there.

Only the map knows what was met minutes ago. That bounds the speed towards it as in a passage, and
the drone does not give way to it: the map may be off by decimetres.
"""

import math
from dataclasses import replace

import numpy as np

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2
from companion.core.messages import Setpoint
from companion.core.values import value
from companion.mapping.occupancy import CELL_M
from companion.safety.control_laws import BRAKING_M_S2, clamp
from companion.safety.obstacle_memory import Surroundings
from companion.safety.obstacle_points import DRIFT_SIGMAS, Points

BODY_RADIUS_M = 0.2
GIVE_WAY_GAIN_1_S = 0.8
MAX_GIVE_WAY_M_S = 0.15
PASSAGE_CLEARANCE_M = 0.14
"""Between the body and either side of a passage, at least."""
PASSAGE_SLACK_M = 0.02
POINT_M = 0.04
"""A surface goes on so far around a point of it."""
BESIDE_M = 0.25
"""What is farther aside of the course than this is beside the drone, not before it."""
PASSAGE_FROM_M, PASSAGE_TO_M = -0.4, 0.8
OPPOSITE_COS, ACROSS_COS = -0.8, 0.7
"""So far in line with the nearest thing is what stands on the other side of the drone, and what is
on either side."""
NARROW_M = 0.7
"""From the middle of a passage to its sides: what is wider is passed as planned."""
CENTRING_GAIN_1_S = 1.2
COURSE_M_S = 0.1
"""Slower than this the drone hovers, and has no course."""
STOPS_M_S2 = 1.0
"""Firmware brakes harder than this besides its lag: from 0.8 m/s it stops within 0.4 to 0.6 m
(docs/autopilot.md). Enough for what is not seen, and most likely is not there."""
CRAWL_M_S = 0.2
"""At which a swing of the nose passes over all of the way before the drone comes there: it goes on
by a third of a metre from one side to the other."""
AMONG_LEGS_M_S = 0.6
"""Faster than this a way that is known too little farther on lets more legs be met too late, and
the mean speed is no higher: `benchmarks/legs.py`."""
FULL_ROUNDS, ROUNDS = 8, 40
MIN_SPEED_M_S = 0.02


def clear_of_all_m(plan: MissionConfig) -> float:
    """From the drone's centre to anything, as planned; in a doorway it is less."""
    return BODY_RADIUS_M + plan.clearance_m


@value
class _Bounds:
    """How fast (n,) the drone may at most move in directions (n, 2), body FRD."""

    towards: Points
    most_m_s: Points


def guarded(setpoint: Setpoint, around: Surroundings, clearance_m: float) -> Setpoint:
    """The velocity as near to `setpoint` as is safe; `clearance_m` is from the body's hull."""
    points = around.points_frd_m
    wanted = np.array([setpoint.forward_m_s, setpoint.right_m_s])
    passage = _passage(points[~np.broadcast_to(around.is_vague, len(points))], wanted)
    bounds = _by_points(around, clearance_m, passage), _by_recalled(around)
    towards = np.concatenate([each.towards for each in bounds])
    most_m_s = np.concatenate([each.most_m_s for each in bounds])
    safe = _bounded(_to_the_middle(wanted, passage), towards, most_m_s)
    forward, right = _through_what_was_passed(safe, around)
    return replace(setpoint, forward_m_s=forward, right_m_s=right)


def _through_what_was_passed(velocity: Vector2, around: Surroundings) -> Vector2:
    """No faster than it stops before what beams have not gone through, but at a crawl."""
    speed_m_s = math.hypot(*velocity)
    least_m_s, most_m_s = (0.0, AMONG_LEGS_M_S) if around.is_among_legs else (CRAWL_M_S, math.inf)
    if speed_m_s <= least_m_s:
        return velocity
    forward_m_s, right_m_s = velocity
    left_m = around.lane(math.atan2(right_m_s, forward_m_s)).clear_m
    left_m -= around.lag_s * math.hypot(*around.velocity_frd_m_s)
    stops_m_s = math.sqrt(2 * STOPS_M_S2 * max(left_m, 0.0))
    most_m_s = min(max(least_m_s, stops_m_s), most_m_s)
    share = min(1.0, most_m_s / speed_m_s)
    return share * forward_m_s, share * right_m_s


def _by_points(around: Surroundings, clearance_m: float, passage: "_Passage | None") -> _Bounds:
    """By what was met lately: below zero where that is too near."""
    towards, away_m = _towards(around.points_frd_m)
    if not len(towards):
        return _Bounds(towards, away_m)
    drifted_m = DRIFT_SIGMAS * np.broadcast_to(around.drift_m, len(away_m))
    planned_m = BODY_RADIUS_M + clearance_m + np.maximum(drifted_m - PASSAGE_CLEARANCE_M, 0.0)
    if passage:
        keep_off_m = _keep_off_m(passage.half_m, planned_m)
    else:
        keep_off_m = _keep_off_askew_m(towards, away_m, planned_m)
    left_m = away_m - POINT_M - keep_off_m - _stopping_m(towards, around)
    gives_way = np.maximum(GIVE_WAY_GAIN_1_S * left_m, -MAX_GIVE_WAY_M_S)
    return _Bounds(towards, np.where(left_m > 0, _may_m_s(left_m), gives_way))


def _by_recalled(around: Surroundings) -> _Bounds:
    """By what was met long ago: never below zero."""
    towards, away_m = _towards(around.recalled_frd_m)
    keep_off_m = BODY_RADIUS_M + PASSAGE_CLEARANCE_M + 0.5 * CELL_M
    return _Bounds(towards, _may_m_s(away_m - keep_off_m - _stopping_m(towards, around)))


def _towards(points: Points) -> tuple[Points, Points]:
    """Unit vectors (n, 2) to points, and how far away they are (n,)."""
    away_m = np.maximum(np.hypot(points[:, 0], points[:, 1]), 1e-3)
    return points / away_m[:, None], away_m


def _stopping_m(towards: Points, around: Surroundings) -> Points:
    """(n,): how far the drone goes on towards each before it begins to brake."""
    closing_m_s = towards @ np.array(around.velocity_frd_m_s)
    lag_m: Points = around.lag_s * np.maximum(closing_m_s, 0.0)
    return lag_m


def _may_m_s(left_m: Points) -> Points:
    """(n,): from so fast it stops within what is left."""
    fast_m_s: Points = np.sqrt(2 * BRAKING_M_S2 * np.maximum(left_m, 0.0))
    return fast_m_s


def _bounded(wanted: Points, towards: Points, most_m_s: Points) -> Vector2:
    """Project onto the bound that is broken worst, often.

    Between two that cannot both be kept the steps become smaller, down to where both are broken
    alike: in too narrow a gap the drone is led to the middle. Hovering, it would drift into a side.
    """
    velocity = wanted.copy()
    if not len(towards):
        return float(velocity[0]), float(velocity[1])
    for round_ in range(ROUNDS):
        over = towards @ velocity - most_m_s
        worst = int(over.argmax())
        if over[worst] <= 1e-6:
            break
        share = min(1.0, FULL_ROUNDS / (round_ + 1))
        velocity = velocity - share * over[worst] * towards[worst]
    return float(velocity[0]), float(velocity[1])


@value
class _Passage:
    """What is nearest on either side of the course, from the drone's centre."""

    left_m: float
    right_m: float

    @property
    def half_m(self) -> float:
        return 0.5 * (self.left_m + self.right_m)


def _passage(points: Points, course: Points) -> _Passage | None:
    """None if there is nothing on either side, or something in between."""
    ahead = _direction(course)
    along_m, aside_m = points @ ahead, points @ np.array((-ahead[1], ahead[0]))
    abreast = (along_m > PASSAGE_FROM_M) & (along_m < PASSAGE_TO_M)
    if (abreast & (along_m > 0) & (np.abs(aside_m) <= BESIDE_M)).any():
        return None  # it is a wall
    right_m = aside_m[abreast & (aside_m > BESIDE_M)]
    left_m = -aside_m[abreast & (aside_m < -BESIDE_M)]
    if not len(right_m) or not len(left_m):
        return None
    return _Passage(float(left_m.min()), float(right_m.min()))


def _direction(course: Points) -> Points:
    speed = float(np.hypot(*course))
    return np.array([1.0, 0.0]) if speed < MIN_SPEED_M_S else course / speed


def _to_the_middle(wanted: Points, passage: _Passage | None) -> Points:
    """The velocity with what leads to the middle of a narrow passage."""
    if passage is None or passage.half_m > NARROW_M or np.hypot(*wanted) < COURSE_M_S:
        return wanted
    ahead = _direction(wanted)
    off_m = 0.5 * (passage.right_m - passage.left_m)
    trim_m_s = clamp(CENTRING_GAIN_1_S * off_m, MAX_GIVE_WAY_M_S)
    centred: Points = wanted + trim_m_s * np.array((-ahead[1], ahead[0]))
    return centred


def _keep_off_m(half_m: float, planned_m: Points) -> Points:
    """(n,): from the drone's centre, in a passage so wide: as planned, or less."""
    room_m = half_m - POINT_M - PASSAGE_SLACK_M
    least_m = np.minimum(planned_m, BODY_RADIUS_M + PASSAGE_CLEARANCE_M)
    keep_off_m: Points = np.maximum(np.minimum(planned_m, room_m), least_m)
    return keep_off_m


def _keep_off_askew_m(towards: Points, away_m: Points, planned_m: Points) -> Points:
    """(n,): as planned, or less from what is on either side, whatever the course."""
    cos_across = towards @ towards[away_m.argmin()]
    opposite_m = float(away_m[cos_across < OPPOSITE_COS].min(initial=np.inf))
    half_m = 0.5 * (float(away_m.min()) + opposite_m)
    is_across = np.abs(cos_across) > ACROSS_COS
    return np.where(is_across, _keep_off_m(half_m, planned_m), planned_m)

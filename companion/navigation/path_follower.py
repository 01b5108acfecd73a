"""Computes the setpoints that fly a path, while the nose swings to both sides of it.

TURN to the next corner's bearing ─► FLY to it, swinging ─► the next corner … ─► arrived

The drone begins to fly while it turns, slower the more it still has to turn: a beam must have swept
the course before the drone flies fast. Then the nose swings (`swing.py`).
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2, wrap_rad
from companion.core.known_walls import KnownWalls
from companion.core.messages import Beam, Pose, Setpoint
from companion.mapping.occupancy import Occupancy
from companion.navigation.observation import Observation
from companion.navigation.swing import TO_THE_RIGHT, Swing
from companion.safety.control_laws import (
    CLOSE_M,
    FULL_STOP_BEFORE_M,
    approach_speed,
    clamp,
    stay,
    stopping_m,
    turn_towards,
)
from companion.safety.velocity_guard import clear_of_all_m

SWINGS_WITHIN_RAD = math.radians(90)
"""Maximum angle between nose and path for a swing, rad; beyond it the nose turns back. Chosen."""
ARRIVED_M = 0.10
"""Arrival radius round the last corner of a path, m. Chosen."""
CORNER_M = 0.15
"""Radius within which a corner of the path counts as passed, m. Chosen."""
STRAIGHT_RAD = math.radians(1)
"""A path that bends by less counts as straight, rad. Chosen."""
ALONG_RAD = math.radians(12)
"""Maximum angle between a beam and the course for the beam to measure along it, rad. Chosen."""
LOOKING = Beam.FRONT, Beam.LEFT, Beam.RIGHT
"""Beams that can measure along a course."""
FLIES_FROM_RAD = math.radians(80)
"""Angle between nose and path below which the drone begins to fly before a beam has pointed along
the course, rad. Chosen."""
BENDS_RAD = math.radians(30)
"""A change of bearing by more than this is a new course, which a beam must sweep first, rad.
Chosen."""
NARROW_M, TIGHT_M = 1.0, 0.4
"""Clearances at which the speed limit is the planned speed, and the minimum, m. Chosen."""
MIN_SPEED_M_S = 0.4
"""Lowest speed limit in narrow places, m/s. Chosen."""
LOOK_AHEAD_M = 0.6
"""Distance ahead of the drone at which the clearance is also evaluated, m. Chosen."""
LOST_SIGMAS, SURE_M = 3.0, 0.6
"""Three sigma of the pose reduce the clearance, after deduction of the second value, m. Chosen: the
planned clearance covers an error up to that."""
WANDERS_M_SQRT_S = 0.03
"""Random walk of odometry, m/√s: twice its noise, for heading and scale. It bounds the error of a
recent detection relative to the drone, even if the pose has a large sigma."""

Way = tuple[Vector2, ...]
"""Corners of a path still to fly, local NED, m; the last one is the goal."""


@dataclass(frozen=True, slots=True)
class Course:
    """A bearing along which a beam has measured free space, within its range."""

    bearing_rad: float
    swing: Swing = TO_THE_RIGHT


def passed(way: Way, observation: Observation, within_m: float) -> Way:
    """The rest of the path, without passed corners; empty within `within_m` of the goal."""
    here = observation.pose.ne_m
    while len(way) > 1 and math.dist(here, way[0]) < CORNER_M:
        way = way[1:]
    return () if len(way) == 1 and math.dist(here, way[0]) < within_m else way


def faced(course: Course | None, way: Way, observation: Observation) -> Course | None:
    """The course to the next corner; None until a beam has pointed along it."""
    bearing_rad = _bearing_rad(way, observation)
    ahead_rad = wrap_rad(bearing_rad - observation.pose.yaw_rad)
    if course and abs(wrap_rad(bearing_rad - course.bearing_rad)) < BENDS_RAD:
        swing = course.swing.onward(-ahead_rad, observation.lane(ahead_rad))
        return replace(course, swing=swing)
    if _looking(bearing_rad, observation) is None:
        return None
    return Course(bearing_rad, Swing(1 if ahead_rad >= 0 else -1))  # continues the turn's direction


def follow(
    way: Way, course: Course | None, observation: Observation, space: Occupancy, plan: MissionConfig
) -> Setpoint:
    """The velocity setpoint along a path, which must not be empty."""
    return _towards(
        way, course, observation, plan, most_speed_m_s(_room_m(observation, space), plan)
    )


def _room_m(observation: Observation, space: Occupancy) -> float:
    """Minimum clearance here and `LOOK_AHEAD_M` ahead, up to 1 m.

    The map's clearance is reduced by the pose's error; that of the side beams is not.
    """
    pose = observation.pose
    ahead_ne_m = (
        pose.north_m + LOOK_AHEAD_M * math.cos(pose.yaw_rad),
        pose.east_m + LOOK_AHEAD_M * math.sin(pose.yaw_rad),
    )
    places = pose.ne_m, ahead_ne_m
    is_lost = LOST_SIGMAS * pose.position_sigma_m > SURE_M
    walls = observation.walls() if is_lost else None
    mapped_m = (_to_mapped_m(place, pose, space, walls) for place in places)
    beside_m = (
        observation.clear_m(beam) for beam in (Beam.LEFT, Beam.RIGHT) if beam in observation.ranges
    )
    return min((*mapped_m, *beside_m))


def _to_mapped_m(
    place_ne_m: Vector2, pose: Pose, space: Occupancy, walls: KnownWalls | None
) -> float:
    """Distance to the nearest mapped obstacle, up to 1 m, reduced by the drone's position error.

    That error is relative to the obstacle: it has grown since the obstacle was last met, or the
    wall on which it lies was last measured, wherever on it. `walls`: None if the error is too small
    to count.
    """
    within_m = NARROW_M + LOST_SIGMAS * pose.position_sigma_m
    met_ne_m, met_s = space.met_near(place_ne_m, within_m)
    away_m = np.hypot(*(met_ne_m - place_ne_m).T)
    if walls is not None:
        met_s = np.maximum(met_s, walls.measured_at_s(met_ne_m))
    wandered_m = WANDERS_M_SQRT_S * np.sqrt(np.maximum(pose.time_s - met_s, 0.0))
    sigma_m = np.minimum(wandered_m, pose.position_sigma_m)
    lost_m = np.maximum(LOST_SIGMAS * sigma_m - SURE_M, 0.0)
    return float((away_m - lost_m).min(initial=NARROW_M))


def most_speed_m_s(room_m: float, plan: MissionConfig) -> float:
    """Speed limit, m/s, which decreases with the clearance `room_m`."""
    wide = (room_m - TIGHT_M) / (NARROW_M - TIGHT_M)
    return max(MIN_SPEED_M_S, min(1.0, wide) * plan.speed_m_s)


def is_blocked(way: Way, observation: Observation) -> bool:
    """True if a beam that points along the path measures an obstacle within stopping distance."""
    if not way or math.dist(observation.pose.ne_m, way[0]) <= CLOSE_M:
        return False
    beam = _looking(_bearing_rad(way, observation), observation)
    return beam is not None and observation.clear_m(beam) <= FULL_STOP_BEFORE_M


def _looking(bearing_rad: float, observation: Observation) -> Beam | None:
    """The beam that points at a bearing, or None."""
    off_rad = bearing_rad - observation.pose.yaw_rad
    for beam in LOOKING:
        aside_rad = wrap_rad(off_rad - observation.bearings_frd_rad[beam])
        if beam in observation.ranges and abs(aside_rad) < ALONG_RAD:
            return beam
    return None


def _bearing_rad(way: Way, observation: Observation) -> float:
    """Bearing to the next corner, rad."""
    return _bearing_between_rad(observation.pose.ne_m, way[0])


def _bearing_between_rad(from_ne_m: Vector2, to_ne_m: Vector2) -> float:
    return math.atan2(to_ne_m[1] - from_ne_m[1], to_ne_m[0] - from_ne_m[0])


def _towards(
    way: Way, course: Course | None, observation: Observation, plan: MissionConfig, most_m_s: float
) -> Setpoint:
    distance_m = math.dist(observation.pose.ne_m, way[0])
    if distance_m < CLOSE_M and len(way) == 1:
        return stay(way[0], observation.pose)
    bearing_rad = _bearing_rad(way, observation)
    off_rad = wrap_rad(bearing_rad - observation.pose.yaw_rad)
    most_rad_s = math.radians(plan.turn_rate_deg_s)
    yaw_rate_rad_s = turn_towards(bearing_rad, observation.pose.yaw_rad, most_rad_s)
    if course and abs(off_rad) < SWINGS_WITHIN_RAD:
        yaw_rate_rad_s = clamp(course.swing.rate_rad_s, most_rad_s)
    nose_on = 1.0 if course else max(0.0, 1 - abs(off_rad) / FLIES_FROM_RAD)
    to_stop_m = distance_m + _beyond_corner_m(observation.pose.ne_m, way, observation.lag_s)
    room_m = min(_room_ahead_m(bearing_rad, observation, plan), to_stop_m)
    speed_m_s = nose_on * approach_speed(room_m, most_m_s, observation.lag_s)
    return Setpoint(
        speed_m_s * math.cos(off_rad),
        speed_m_s * math.sin(off_rad),
        yaw_rate_rad_s=yaw_rate_rad_s,
    )


def _beyond_corner_m(here_ne_m: Vector2, way: Way, lag_s: float) -> float:
    """Distance beyond the next corner, m, in which the drone may stop: 0 at the goal.

    The drone turns `CORNER_M` before a corner. During the lag, and while it brakes, it still flies
    across the next leg with v·sin(bend). It may go beyond that leg by `ARRIVED_M`.
    """
    beyond_m = 0.0
    for before, corner, after in reversed(list(zip((here_ne_m, *way), way, way[1:], strict=False))):
        bend_rad = wrap_rad(
            _bearing_between_rad(corner, after) - _bearing_between_rad(before, corner)
        )
        across = math.sin(min(max(abs(bend_rad), STRAIGHT_RAD), math.pi / 2))
        across_m_s = approach_speed(CORNER_M * across + ARRIVED_M, math.inf, lag_s)
        in_turn_m = stopping_m(across_m_s / across, lag_s)
        beyond_m = min(in_turn_m, math.dist(corner, after) + beyond_m)
    return beyond_m


def _room_ahead_m(bearing_rad: float, observation: Observation, plan: MissionConfig) -> float:
    """Free distance along the path from the beam that points there, or else the front beam, m.

    An obstacle that the front beam detects beside the path does not limit the distance.
    """
    beam = _looking(bearing_rad, observation)
    if beam is not None:
        return observation.clear_m(beam) - FULL_STOP_BEFORE_M
    clear_m = observation.clear_m(Beam.FRONT)
    aside_m = clear_m * math.sin(abs(wrap_rad(bearing_rad - observation.pose.yaw_rad)))
    return math.inf if aside_m > clear_of_all_m(plan) else clear_m - FULL_STOP_BEFORE_M

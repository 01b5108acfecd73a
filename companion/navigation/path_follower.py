"""Along a way, the nose swinging to and fro about it.

TURN to the next corner's bearing ─► FLY to it, swinging ─► the next corner … ─► arrived

It begins to fly while it still turns, the slower the farther it has to: a beam must have looked
along the course before the drone is quick. Then its nose swings (`swing.py`).
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2, wrap_rad
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
    turn_towards,
)
from companion.safety.velocity_guard import clear_of_all_m

SWINGS_WITHIN_RAD = math.radians(90)
"""With the nose farther off the way it does not swing: it turns back to the way."""
ARRIVED_M = 0.10
CORNER_M = 0.15
"""A corner of the way counts as passed within this."""
ALONG_RAD = math.radians(12)
"""A beam points along the course within this."""
LOOKING = Beam.FRONT, Beam.LEFT, Beam.RIGHT
FLIES_FROM_RAD = math.radians(80)
BENDS_RAD = math.radians(30)
"""A course that bends by more is another one, and has to be faced first."""
NARROW_M, TIGHT_M = 1.0, 0.4
"""With so much room the drone flies as fast as planned, and with so little as slowly as it does."""
MIN_SPEED_M_S = 0.4
LOOK_AHEAD_M = 0.6
LOST_SIGMAS, SURE_M = 3.0, 0.6
"""Three sigma of the pose, up to so much, are what the clearance is for."""
WANDERS_M_SQRT_S = 0.03
"""Odometry, in a second: twice its noise, for heading and scale. What was met a moment ago is no
farther off than that, however far the drone may be from where it began."""

Way = tuple[Vector2, ...]


@dataclass(frozen=True, slots=True)
class Course:
    """A beam has pointed along it: nothing stood there, as far as that sees."""

    bearing_rad: float
    swing: Swing = TO_THE_RIGHT


def passed(way: Way, observation: Observation, within_m: float) -> Way:
    """What is left of the way; nothing so near to its end."""
    here = observation.pose.ne_m
    while len(way) > 1 and math.dist(here, way[0]) < CORNER_M:
        way = way[1:]
    return () if len(way) == 1 and math.dist(here, way[0]) < within_m else way


def faced(course: Course | None, way: Way, observation: Observation) -> Course | None:
    """The course to the next corner; None as long as no beam has pointed along it."""
    bearing_rad = _bearing_rad(way, observation)
    ahead_rad = wrap_rad(bearing_rad - observation.pose.yaw_rad)
    if course and abs(wrap_rad(bearing_rad - course.bearing_rad)) < BENDS_RAD:
        swing = course.swing.onward(-ahead_rad, observation.lane(ahead_rad))
        return replace(course, swing=swing)
    if _looking(bearing_rad, observation) is None:
        return None
    return Course(bearing_rad, Swing(1 if ahead_rad >= 0 else -1))  # on from the turn


def follow(
    way: Way, course: Course | None, observation: Observation, space: Occupancy, plan: MissionConfig
) -> Setpoint:
    """The velocity that flies a way, of which something is left."""
    return _towards(
        way, course, observation, plan, most_speed_m_s(_room_m(observation, space), plan)
    )


def _room_m(observation: Observation, space: Occupancy) -> float:
    """To what is mapped, up to a metre: the least from here, and from where it will be soon.

    What the beams to the sides meet, they meet wherever the drone is.
    """
    pose = observation.pose
    ahead_ne_m = (
        pose.north_m + LOOK_AHEAD_M * math.cos(pose.yaw_rad),
        pose.east_m + LOOK_AHEAD_M * math.sin(pose.yaw_rad),
    )
    places = pose.ne_m, ahead_ne_m
    mapped_m = (_to_mapped_m(place, pose, space) for place in places)
    beside_m = (
        observation.clear_m(beam) for beam in (Beam.LEFT, Beam.RIGHT) if beam in observation.ranges
    )
    return min((*mapped_m, *beside_m))


def _to_mapped_m(place_ne_m: Vector2, pose: Pose, space: Occupancy) -> float:
    """To what is mapped, up to a metre, less how far the drone may be off that."""
    within_m = NARROW_M + LOST_SIGMAS * pose.position_sigma_m
    met_ne_m, met_s = space.met_near(place_ne_m, within_m)
    away_m = np.hypot(*(met_ne_m - place_ne_m).T)
    wandered_m = WANDERS_M_SQRT_S * np.sqrt(np.maximum(pose.time_s - met_s, 0.0))
    sigma_m = np.minimum(wandered_m, pose.position_sigma_m)
    lost_m = np.maximum(LOST_SIGMAS * sigma_m - SURE_M, 0.0)
    return float((away_m - lost_m).min(initial=NARROW_M))


def most_speed_m_s(room_m: float, plan: MissionConfig) -> float:
    """Slow where it is narrow."""
    wide = (room_m - TIGHT_M) / (NARROW_M - TIGHT_M)
    return max(MIN_SPEED_M_S, min(1.0, wide) * plan.speed_m_s)


def is_blocked(way: Way, observation: Observation) -> bool:
    """Something stands where the way leads, and a beam points there."""
    if not way or math.dist(observation.pose.ne_m, way[0]) <= CLOSE_M:
        return False
    beam = _looking(_bearing_rad(way, observation), observation)
    return beam is not None and observation.clear_m(beam) <= FULL_STOP_BEFORE_M


def _looking(bearing_rad: float, observation: Observation) -> Beam | None:
    """The beam that points there."""
    off_rad = bearing_rad - observation.pose.yaw_rad
    for beam in LOOKING:
        aside_rad = wrap_rad(off_rad - observation.bearings_frd_rad[beam])
        if beam in observation.ranges and abs(aside_rad) < ALONG_RAD:
            return beam
    return None


def _bearing_rad(way: Way, observation: Observation) -> float:
    """To the next corner."""
    return math.atan2(way[0][1] - observation.pose.east_m, way[0][0] - observation.pose.north_m)


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
    room_m = min(_room_ahead_m(bearing_rad, observation, plan), distance_m)
    speed_m_s = nose_on * approach_speed(room_m, most_m_s, observation.lag_s)
    return Setpoint(
        speed_m_s * math.cos(off_rad),
        speed_m_s * math.sin(off_rad),
        yaw_rate_rad_s=yaw_rate_rad_s,
    )


def _room_ahead_m(bearing_rad: float, observation: Observation, plan: MissionConfig) -> float:
    """Along the way, as far as a beam tells; what the front beam meets beside the way is passed."""
    beam = _looking(bearing_rad, observation)
    if beam is not None:
        return observation.clear_m(beam) - FULL_STOP_BEFORE_M
    clear_m = observation.clear_m(Beam.FRONT)
    aside_m = clear_m * math.sin(abs(wrap_rad(bearing_rad - observation.pose.yaw_rad)))
    return math.inf if aside_m > clear_of_all_m(plan) else clear_m - FULL_STOP_BEFORE_M

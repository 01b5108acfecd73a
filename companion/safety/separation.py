"""Keeps drones of a team apart.

All fly at the height of the mission, so that all fit under the lintels of doors. Of two that meet,
one has the right of way. The other climbs on the spot, if the ceiling allows it, and lets the first
pass below. Until they are far enough apart in height, both keep apart horizontally: the one with
the right of way at a distance at which both are safe, the other at a larger one, so that only it
turns aside. Its path leads round the one with the right of way. A drone that takes off, descends or
lands has the right of way over all others.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import Vector2, points_to_frd, wrap_rad
from companion.core.messages import (
    BEARING_FRD_RAD,
    STALE,
    Beam,
    Pose,
    RangeReading,
    RangeScan,
    RangeState,
)
from companion.core.values import value
from companion.safety.control_laws import BODY_RADIUS_M, approach_speed

MIN_VERTICAL_M = 0.62
"""Two drones at least so far apart in height pass each other freely, m. Chosen: the bodies are 0.22
m apart."""
PASSING_M = 0.75
"""Climb of a drone that lets another one pass below, m. Chosen: beyond `MIN_VERTICAL_M`, by the
errors of two heights."""
KEEP_OFF_M, YIELD_M = 0.9, 1.2
"""Horizontal distance between the centres that a drone with the right of way keeps, and one
without, m. Chosen: the bodies are 0.5 m apart at the first."""
PASS_WITHIN_M, PASSED_AT_M = 0.2, 0.8
"""A drone without the right of way climbs within the first distance beyond `YIELD_M` of the other,
and descends again beyond the second, m. Chosen."""
ROUND_WITHIN_M = 4.0
"""A path leads round a teammate that is nearer than this, m. Chosen: beyond the
stopping distance of both. A teammate farther away has left before the drone is there."""
MASK_M = 0.15
"""A beam that passes a teammate's body within this distance may have met it, m, beside three sigmas
of its position. Chosen."""
MASK_SIGMAS = 3.0
FACES_RAD = math.radians(15)
"""Two infrared sensors that point at each other within this angle dazzle each other, rad, beside
the error of a teammate's heading. Chosen: the width of a beam, and the mounting of both. Then any
distance may be measured."""


@value
class OtherDrone:
    """A teammate near this drone, in this drone's frame."""

    ne_m: Vector2
    height_m: float
    yaw_rad: float
    yaw_off_rad: float
    """Largest error of its heading."""
    sigma_m: float
    """Of its position relative to this drone, on each axis."""
    is_flying: bool
    """It is in the air; else it stands on the ground."""
    needs_column: bool
    """It climbs or descends: the space above and below it must be free."""
    has_right_of_way: bool
    """By the order of the drones' numbers."""
    stopped_within_m: float = 0.0
    """A drone that is not heard any more has stopped within this distance of its place, m."""

    @property
    def off_m(self) -> float:
        """How far it may be from its place, m."""
        return self.sigma_m + self.stopped_within_m


@value
class KeepOut:
    """The place of a teammate round which a path leads, in this drone's frame."""

    ne_m: Vector2
    radius_m: float


@value
class Passing:
    """State of a drone that lets a teammate pass below, from the climb until it is down again."""

    at_ne_m: Vector2
    """Place at which it climbs, local NED, m."""
    ceiling_m: float
    """Height of the lowest obstacle above that the up beam has measured meanwhile, m. The ceiling
    may come too near to be measured."""

    def height_m(self, level_m: float, clearance_m: float) -> float:
        """Height to climb to, m; `level_m` is the height at which the drone flies otherwise."""
        return min(level_m + PASSING_M, self.ceiling_m - BODY_RADIUS_M - clearance_m)

    def see(self, pose: Pose, up: RangeReading, mount_offset_m: float) -> "Passing":
        """Lower the ceiling to a reading of the up beam."""
        above_m = pose.height_m + mount_offset_m + up.distance_m
        return replace(self, ceiling_m=above_m) if above_m < self.ceiling_m else self


def passing_from(
    pose: Pose,
    up: RangeReading,
    mount_offset_m: float,
    level_m: float,
    clearance_m: float,
    *,
    top_m: float = math.inf,
) -> Passing | None:
    """The state at the begin of a climb; None if the up beam has not measured enough room for it.

    A drone in a doorway must not climb against the lintel. `top_m` is the greatest height, m.
    """
    if not (up.is_distance or up.state is RangeState.NOTHING):
        return None
    lowest_m = top_m + BODY_RADIUS_M + clearance_m
    begun = Passing(pose.ne_m, lowest_m).see(pose, up, mount_offset_m)
    has_room = begun.height_m(level_m, clearance_m) - level_m >= MIN_VERTICAL_M
    return begun if has_room else None


def keep_off(others: Sequence[OtherDrone], pose: Pose, needs_column: bool) -> tuple[Array, Array]:
    """Positions (n, 2) of the teammates to keep away from, body FRD, and the distances (n,), m."""
    near = _at_height(others, pose, needs_column)
    places = np.array([each.ne_m for each in near]).reshape(-1, 2) - pose.ne_m
    distances = [
        (YIELD_M if _must_yield(each, needs_column) else KEEP_OFF_M) + each.off_m for each in near
    ]
    return points_to_frd(places, pose.yaw_rad), np.array(distances)


def keep_outs(others: Sequence[OtherDrone], pose: Pose, needs_column: bool) -> tuple[KeepOut, ...]:
    """Places of the teammates near the drone to which it gives way."""
    return tuple(
        KeepOut(each.ne_m, YIELD_M + each.off_m)
        for each in _at_height(others, pose, needs_column)
        if _must_yield(each, needs_column) and math.dist(each.ne_m, pose.ne_m) < ROUND_WITHIN_M
    )


def _at_height(others: Sequence[OtherDrone], pose: Pose, needs_column: bool) -> list[OtherDrone]:
    """The teammates in the air that do not pass above or below this drone."""
    flying = (each for each in others if each.is_flying)
    return [each for each in flying if _is_at_height(each, pose.height_m, needs_column)]


def _is_at_height(other: OtherDrone, height_m: float, needs_column: bool) -> bool:
    if other.needs_column or needs_column:
        return True
    return abs(other.height_m - height_m) < MIN_VERTICAL_M


def _must_yield(other: OtherDrone, needs_column: bool) -> bool:
    """True if this drone gives way. A drone in its column has the right of way over all others."""
    if other.needs_column != needs_column:
        return other.needs_column
    return other.has_right_of_way


def lets_pass(others: Sequence[OtherDrone], pose: Pose, level_m: float, *, passes: bool) -> bool:
    """True if the drone is to be above a teammate that has the right of way.

    `level_m`: height at which the drone flies otherwise, m. `passes`: it is above already.
    """
    within_m = YIELD_M + (PASSED_AT_M if passes else PASS_WITHIN_M)
    return any(
        each.has_right_of_way
        and each.is_flying
        and not each.needs_column
        and abs(each.height_m - level_m) < MIN_VERTICAL_M
        and math.dist(each.ne_m, pose.ne_m) < within_m + each.off_m
        for each in others
    )


def is_column_free(others: Sequence[OtherDrone], pose: Pose) -> bool:
    """True if no teammate flies near the column above the drone."""
    return not any(
        each.is_flying and math.dist(each.ne_m, pose.ne_m) < KEEP_OFF_M + each.off_m
        for each in others
    )


def climb_limits(
    others: Sequence[OtherDrone], pose: Pose, max_climb_m_s: float, lag_s: float
) -> tuple[float, float]:
    """Least and greatest down velocity, m/s, with which the drone stays clear in height."""
    up_m_s = down_m_s = max_climb_m_s
    for other in others:
        is_near = math.dist(other.ne_m, pose.ne_m) <= YIELD_M + other.off_m
        if not (is_near and other.is_flying):
            continue
        apart_m = other.height_m - pose.height_m
        free_m_s = max(approach_speed(abs(apart_m) - MIN_VERTICAL_M, max_climb_m_s, lag_s), 0.0)
        if apart_m > 0:
            up_m_s = min(up_m_s, free_m_s)
        else:
            down_m_s = min(down_m_s, free_m_s)
    return -up_m_s, down_m_s


def without_others(
    scan: RangeScan,
    pose: Pose,
    others: Sequence[OtherDrone],
    bearings_frd_rad: Mapping[Beam, float],
) -> RangeScan:
    """The scan, with readings that may be of a teammate's body instead of a wall as STALE."""
    masked = {
        beam: STALE
        for beam, reading in scan.readings.items()
        if reading.is_alive
        and reading.state is not RangeState.NOTHING
        and any(
            _may_meet(beam, reading.distance_m, pose, other, bearings_frd_rad) for other in others
        )
    }
    return RangeScan(scan.time_s, {**scan.readings, **masked}) if masked else scan


def _may_meet(
    beam: Beam,
    distance_m: float,
    pose: Pose,
    other: OtherDrone,
    bearings_frd_rad: Mapping[Beam, float],
) -> bool:
    reach_m = BODY_RADIUS_M + MASK_M + MASK_SIGMAS * other.sigma_m
    above_m = other.height_m - pose.height_m
    aside_m = math.dist(other.ne_m, pose.ne_m)
    if beam in (Beam.UP, Beam.DOWN):
        away_m = above_m if beam is Beam.UP else -above_m
        return aside_m < reach_m and away_m > 0 and not distance_m < away_m - reach_m
    if abs(above_m) > BODY_RADIUS_M + MASK_M:
        return False
    bearing_rad = pose.yaw_rad + bearings_frd_rad.get(beam, BEARING_FRD_RAD[beam])
    unit = math.cos(bearing_rad), math.sin(bearing_rad)
    off = other.ne_m[0] - pose.north_m, other.ne_m[1] - pose.east_m
    ahead_m = off[0] * unit[0] + off[1] * unit[1]
    beside_m = abs(off[0] * unit[1] - off[1] * unit[0])
    if ahead_m <= 0 or beside_m >= reach_m:
        return False
    return _faces(other, bearing_rad) or not distance_m < ahead_m - reach_m


def _faces(other: OtherDrone, bearing_rad: float) -> bool:
    """True if a level beam of the teammate may dazzle one that points at it along a bearing."""
    back_rad = bearing_rad + math.pi - other.yaw_rad
    within_rad = FACES_RAD + other.yaw_off_rad
    return any(abs(wrap_rad(back_rad - axis)) < within_rad for axis in BEARING_FRD_RAD.values())

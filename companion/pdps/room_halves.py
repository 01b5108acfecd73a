"""Divides the round of a room between two drones: opposite ways along the walls, until they meet.

    ┌──────────────────────┐
    │ ◄── 2    start  1 ──► │    both begin at one wall; the drone that comes first chooses the way
    │ │                  │  │    that leads away from the other, and the other the opposite way
    │ ▼                  ▼  │
    │    ──► 2    1 ◄──     │    they meet: the other ends its scan and leaves; the first goes on to
    └──────────────────────┘     where the other has been

If the other drone falls silent or lands, the first traces the rest: only the track counts.
"""

import math
from dataclasses import replace

import numpy as np

from companion.core.frames import Vector2, ned_to_frd, wrap_rad
from companion.navigation.observation import Observation, Tracing
from companion.pdps.perpendicular import SAME_WALL_RAD
from companion.pdps.room_scan_state import RoomScan, ScanPhase

MEETS_M = 4.0
"""Two drones meet within this distance along the wall, m. Chosen: the one that leaves is out of the
other's way before they keep off each other."""
ASIDE_M = 1.0
"""A teammate at the same wall is within this distance of this drone's path, m. Chosen."""
TRACED_M = 0.4
"""This drone has reached the track of a teammate within this distance, m. Chosen: the spacing of
the track's marks, and the error of the alignment."""
MIN_CORNERS = 1
"""Least corners before two drones can meet: they begin side by side."""


def to_other_ne_m(observation: Observation) -> Vector2 | None:
    """From this drone to the other one, m; None without another one in the air."""
    for other in observation.tracings:
        if other.is_flying:
            pose = observation.pose
            return other.ne_m[0] - pose.north_m, other.ne_m[1] - pose.east_m
    return None


def other_wall_rad(heading_rad: float | None, observation: Observation) -> float | None:
    """Bearing of the wall at which the other drone begins, rad, unless this one faces it.

    Both begin at one wall; else the walls between their starts would not be traced. `heading_rad`
    is None for a drone that has no wall in range.
    """
    for other in observation.tracings:
        leads = other.comes_first or other.is_tracing
        if leads and other.wall_rad is not None:
            if heading_rad is None:
                return other.wall_rad
            is_same = abs(wrap_rad(other.wall_rad - heading_rad)) < SAME_WALL_RAD
            return None if is_same else other.wall_rad
    return None


def facing_other_wall(
    scan: RoomScan, heading_rad: float | None, observation: Observation
) -> RoomScan | None:
    """The scan that faces the wall of the other drone; None if `heading_rad` faces it already."""
    wall_rad = other_wall_rad(heading_rad, observation)
    if wall_rad is None:
        return None
    return RoomScan(ScanPhase.FACE, side=scan.side, heading_rad=wall_rad)


def divided(scan: RoomScan, observation: Observation) -> RoomScan:
    """The scan with the way round that is left to this drone."""
    if not observation.tracings:
        return scan
    other = observation.tracings[0]
    if other.side and (other.comes_first or other.is_tracing):
        side = -other.side
    else:
        _, right_m = _frd_m(scan, observation, other.ne_m)
        side = -1 if right_m > 0 else 1
    return scan if side == scan.side else replace(scan, side=side)


def has_met(scan: RoomScan, observation: Observation, gap_m: float) -> bool:
    """True if the rest of the round is another drone's, or was traced by it.

    `gap_m`: distance along the wall to the stand-off of the next wall.
    """
    if scan.corners < MIN_CORNERS:
        return False
    return any(
        _is_on_track(other, observation.pose.ne_m)
        or (other.comes_first and other.is_tracing and _is_ahead(scan, observation, other, gap_m))
        for other in observation.tracings
    )


def _is_on_track(other: Tracing, here_ne_m: Vector2) -> bool:
    off_m = np.hypot(*(other.track_ne_m - here_ne_m).T)
    return float(off_m.min(initial=math.inf)) < TRACED_M


def _is_ahead(scan: RoomScan, observation: Observation, other: Tracing, gap_m: float) -> bool:
    """True if the other drone comes towards this one, along the same wall or the next one."""
    forward_m, right_m = _frd_m(scan, observation, other.ne_m)
    ahead_m = scan.side * right_m
    is_near_wall = abs(forward_m) < ASIDE_M or abs(ahead_m - gap_m) < ASIDE_M
    is_coming = other.side == -scan.side and is_near_wall
    return is_coming and ahead_m > 0 and ahead_m + abs(forward_m) < MEETS_M


def _frd_m(scan: RoomScan, observation: Observation, ne_m: Vector2) -> Vector2:
    """A place relative to this drone, forward to the wall and to the right along it, m."""
    pose = observation.pose
    return ned_to_frd(ne_m[0] - pose.north_m, ne_m[1] - pose.east_m, scan.heading_rad)

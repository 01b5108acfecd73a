"""Tracing one room: turn, find the nearest wall, keep off it, go round parallel to the walls.

            nothing returned          front returns
    TURN ─────────────────────► SEEK ─────────────► TURN
     │ nearest wall found
     ▼
    FACE ──► STAND_OFF ──► SCAN ──────────────────────────► CLOSED
    nose to    keep the    │ ▲ │ ▲   all corners turned and
    the wall   distance    ▼ │ │ │   past where the scan began
                        CORNER ▼ │
                              SWEEP
    CORNER: the right beam meets the next wall, turn 90° right
    SWEEP:  the way along is not known to be free, look at that side of it
    SCAN, not known to be free where it swept before ─► BLOCKED
    STAND_OFF, not there within half a minute ─► BLOCKED
    SCAN, past where it began ─► SCAN: round again, if the walls are not known well by then

The drone faces the wall and moves to its right, so the room is traced clockwise and the right
beam looks where the drone goes. It swings its nose to and fro meanwhile, so that the beam passes
over all of the way ahead and not only over its middle: wide where a leg begins, and little later.

Along a wall longer than its range odometry alone tells how far apart the walls at its ends are. If
that is known too badly after one round, each further one tells it as well again; they are extras.

Safety: it moves only forward and right, where a beam looks, and along the wall only through space
that is known to be free as wide as the drone; it backs away from a wall no farther than the first
turn has shown free; a beam that fails stops the movement along it.
"""

import math
from dataclasses import replace

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2, frd_to_ned, ned_to_frd, wrap_rad
from companion.core.known_walls import KnownWalls
from companion.core.messages import HOLD, Beam, RangeState, Setpoint
from companion.mapping.occupancy import Occupancy
from companion.navigation.observation import Observation
from companion.navigation.swing import TO_THE_RIGHT
from companion.pdps.perpendicular import TurnReading, find_perpendicular, free_distance
from companion.pdps.room_scan_state import Mark, RoomScan, ScanPhase
from companion.safety.control_laws import (
    FULL_STOP_BEFORE_M,
    approach_speed,
    clamp,
    keep_distance,
    stay,
    turn_towards,
)
from companion.safety.velocity_guard import BODY_RADIUS_M

QUARTER_TURN_RAD = math.pi / 2
ON_HEADING_RAD = math.radians(2.5)
ROUND_CORNER_RAD = math.radians(15)
"""When no more than this is left of a corner's turn, the drone already sets off along the next
wall: the right beam looks there."""
AT_STANDOFF_M = 0.10
STANDOFF_WITHIN_S = 30.0
"""When it has not come there by then, something keeps the drone off."""
SEEN_BY_ONE_TURN_M = 3.0
"""How far back one turn is trusted to have seen free space."""
MIN_ROOM_BEHIND_M = 0.7
SEEK_UNTIL_M = 4.0
CORNER_READINGS = 2
"""Consecutive readings that must agree before a corner is believed."""
CORNER_MARGIN_M = 0.12
CORNERS_OF_A_ROOM = 4
CLOSING_OVERLAP_M, CLOSING_WITHIN_M = 0.3, 1.5
CLOSING_RAD = math.radians(20)
MARK_EVERY_M = 0.5
REFINEMENT_RAD = math.radians(30)
"""Of its heading at once: so far a step of the pose may turn the map, of which the heading knows
nothing."""
KNOWN_AHEAD_M = 1.3
"""From the drone's centre along the wall; with less it looks before it goes on."""
HALF_WAY_M = 0.5
SWEEP_RAD, ON_SWEEP_RAD = math.radians(70), math.radians(5)
"""So far aside that the beam passes over all of the way from a hand before the drone on."""
SWEPT_WITHIN_M = 0.25
LOOSE_M, MAX_EXTRA_ROUNDS = 0.06, 2
"""Sigma of the distance between two walls that is worth another round."""

_TURNING = (Beam.FRONT, Beam.RIGHT, Beam.LEFT)
"""What looks for the nearest wall in the first turn."""


def step(
    scan: RoomScan, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    """One tick: the next state and the velocity to fly."""
    standoff_m = min(observation.standoff_m, scan.most_standoff_m)
    if standoff_m != scan.standoff_m:
        scan = replace(scan, standoff_m=standoff_m)
    if scan.phase is ScanPhase.SCAN and (sides := _unknown_sides(scan, observation, space)):
        scan = _begin_sweep(scan, observation, sides)
    scan, setpoint = _MOVES[scan.phase](scan, observation, plan)
    return scan, Setpoint(
        _guarded(setpoint.forward_m_s, Beam.FRONT, observation),
        _guarded(setpoint.right_m_s, Beam.RIGHT, observation),
        yaw_rate_rad_s=setpoint.yaw_rate_rad_s,
    )


def _turn(
    scan: RoomScan, observation: Observation, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    yaw_rad = observation.pose.yaw_rad
    last_rad = yaw_rad if scan.last_yaw_rad is None else scan.last_yaw_rad
    scan = replace(
        scan,
        turned_rad=scan.turned_rad + wrap_rad(yaw_rad - last_rad),
        last_yaw_rad=yaw_rad,
        turn=scan.turn + _rays(observation),
    )
    if scan.turned_rad < math.tau:
        return scan, Setpoint(yaw_rate_rad_s=math.radians(plan.turn_rate_deg_s))
    nearest = find_perpendicular(scan.turn)
    if nearest is None:
        return RoomScan(phase=ScanPhase.SEEK, heading_rad=yaw_rad), Setpoint()
    behind_m = free_distance(scan.turn, nearest.bearing_rad + math.pi, SEEN_BY_ONE_TURN_M)
    may_back_m = max(behind_m - MIN_ROOM_BEHIND_M, 0.0)
    faced = RoomScan(
        phase=ScanPhase.FACE,
        heading_rad=nearest.bearing_rad,
        most_standoff_m=nearest.distance_m + may_back_m,
    )
    return faced, Setpoint()


def _rays(observation: Observation) -> tuple[TurnReading, ...]:
    return tuple(
        TurnReading(
            wrap_rad(observation.pose.yaw_rad + observation.bearings_frd_rad[beam]),
            reading.distance_m + observation.mount_offset_m,
            math.sqrt(reading.variance_m2),
        )
        for beam in _TURNING
        if (reading := observation.ranges.get(beam)) is not None and reading.is_distance
    )


def _seek(
    scan: RoomScan, observation: Observation, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    ahead_m = observation.clear_m(Beam.FRONT)
    if ahead_m < max(SEEK_UNTIL_M, observation.standoff_m):
        return RoomScan(), Setpoint()
    yaw_rate = _turn_rate(scan, observation, plan)
    return scan, Setpoint(forward_m_s=0.5 * plan.speed_m_s, yaw_rate_rad_s=yaw_rate)


def _face(
    scan: RoomScan, observation: Observation, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    scan = _refined(scan, observation)
    if _on_heading(scan, observation):
        return replace(scan, phase=ScanPhase.STAND_OFF, faced_s=observation.pose.time_s), Setpoint()
    return scan, Setpoint(yaw_rate_rad_s=_turn_rate(scan, observation, plan))


def _stand_off(
    scan: RoomScan, observation: Observation, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    scan = _refined(scan, observation)
    distance_m = _wall_distance_m(scan, observation)
    if abs(distance_m - scan.standoff_m) < AT_STANDOFF_M and _on_heading(scan, observation):
        return replace(scan, phase=ScanPhase.SCAN), Setpoint()
    if observation.pose.time_s - scan.faced_s > STANDOFF_WITHIN_S:
        return replace(scan, phase=ScanPhase.BLOCKED), Setpoint()
    forward = keep_distance(distance_m, scan.standoff_m, 0.7 * plan.speed_m_s)
    return scan, Setpoint(forward, yaw_rate_rad_s=_turn_rate(scan, observation, plan))


def _scan(
    scan: RoomScan, observation: Observation, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    scan = _marked(_refined(scan, observation), observation)
    if _is_closed(scan, observation):
        if scan.extra_rounds == MAX_EXTRA_ROUNDS or not _are_loose(observation.walls()):
            return replace(scan, phase=ScanPhase.CLOSED), Setpoint()
        scan = replace(scan, extra_rounds=scan.extra_rounds + 1, marks=scan.marks[-1:])
    gap_m = _gap_m(scan, observation)
    met = _meets_wall(observation) and gap_m < CORNER_MARGIN_M
    corner_readings = scan.corner_readings + 1 if met else 0
    if corner_readings != scan.corner_readings:
        scan = replace(scan, corner_readings=corner_readings)
    if scan.corner_readings >= CORNER_READINGS:
        turned = replace(
            scan,
            phase=ScanPhase.CORNER,
            heading_rad=wrap_rad(scan.heading_rad + QUARTER_TURN_RAD),
            corner_readings=0,
            corner_ne_m=_along_m(scan, observation, gap_m),
        )
        return turned, Setpoint()
    along_rad = wrap_rad(scan.heading_rad + QUARTER_TURN_RAD - observation.pose.yaw_rad)
    off_rad = wrap_rad(observation.pose.yaw_rad - scan.heading_rad)
    scan = replace(scan, swing=scan.swing.onward(off_rad, observation.lane(along_rad)))
    along = _along_wall(scan, observation, plan)
    swings_rad_s = clamp(scan.swing.rate_rad_s, math.radians(plan.turn_rate_deg_s))
    return scan, replace(along, yaw_rate_rad_s=swings_rad_s)


def _along_m(scan: RoomScan, observation: Observation, along_m: float) -> Vector2:
    """The place so far along the wall from here."""
    north_m, east_m = frd_to_ned(0.0, along_m, scan.heading_rad)
    return observation.pose.north_m + north_m, observation.pose.east_m + east_m


def _along_wall(scan: RoomScan, observation: Observation, plan: MissionConfig) -> Setpoint:
    """At the stand-off, up to where the next wall begins."""
    wall_m = _wall_distance_m(scan, observation)
    towards_m_s = keep_distance(wall_m, scan.standoff_m, 0.4 * plan.speed_m_s)
    along_m_s = approach_speed(_gap_m(scan, observation), plan.speed_m_s, observation.lag_s)
    off_rad = wrap_rad(observation.pose.yaw_rad - scan.heading_rad)
    return Setpoint(*ned_to_frd(towards_m_s, along_m_s, off_rad))


def _unknown_sides(scan: RoomScan, observation: Observation, space: Occupancy) -> list[int]:
    """On which sides of the way along the wall, 1 towards it, too little is known to be free.

    Enough is some way ahead, or up to the next wall. No sweep passes over what is at its flanks.
    """
    along_rad = scan.heading_rad + QUARTER_TURN_RAD
    enough_m = min(KNOWN_AHEAD_M, _gap_m(scan, observation) + BODY_RADIUS_M)
    unknown = []
    for side in (1, -1):
        off = frd_to_ned(side * 0.5 * HALF_WAY_M, BODY_RADIUS_M, scan.heading_rad)
        middle = observation.pose.north_m + off[0], observation.pose.east_m + off[1]
        known_m = space.known_free_m(middle, along_rad, 0.5 * HALF_WAY_M, KNOWN_AHEAD_M)
        if BODY_RADIUS_M + known_m < enough_m:
            unknown.append(side)
    return unknown


def _begin_sweep(scan: RoomScan, observation: Observation, sides: list[int]) -> RoomScan:
    """Turn so far that the right beam passes over what is unknown, and back."""
    here = observation.pose.ne_m
    if scan.swept_ne_m is not None and math.dist(here, scan.swept_ne_m) < SWEPT_WITHIN_M:
        return replace(scan, phase=ScanPhase.CLOSED if scan.is_extra else ScanPhase.BLOCKED)
    aside = tuple(scan.heading_rad - side * SWEEP_RAD for side in sides)
    headings = (*aside, scan.heading_rad)
    return replace(scan, phase=ScanPhase.SWEEP, sweep_rad=headings, swept_ne_m=here)


def _sweep(
    scan: RoomScan, observation: Observation, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    heading_rad, *later = scan.sweep_rad
    holding = HOLD if scan.swept_ne_m is None else stay(scan.swept_ne_m, observation.pose)
    if abs(wrap_rad(heading_rad - observation.pose.yaw_rad)) > ON_SWEEP_RAD:
        most_rad_s = math.radians(plan.turn_rate_deg_s)
        rate_rad_s = turn_towards(heading_rad, observation.pose.yaw_rad, most_rad_s)
        return scan, replace(holding, yaw_rate_rad_s=rate_rad_s)
    phase = ScanPhase.SWEEP if later else ScanPhase.SCAN
    return replace(scan, phase=phase, sweep_rad=tuple(later)), holding


def _blocked(
    scan: RoomScan, observation: Observation, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    return scan, Setpoint()


def _corner(
    scan: RoomScan, observation: Observation, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    if _on_heading(scan, observation):
        corners = scan.corners + 1
        scan = replace(scan, phase=ScanPhase.SCAN, corners=corners, swing=TO_THE_RIGHT)
        return scan, _along_wall(scan, observation, plan)
    is_nearly_round = abs(wrap_rad(scan.heading_rad - observation.pose.yaw_rad)) < ROUND_CORNER_RAD
    turning = stay(scan.corner_ne_m, observation.pose)
    moving = _along_wall(scan, observation, plan) if is_nearly_round else turning
    return scan, replace(moving, yaw_rate_rad_s=_turn_rate(scan, observation, plan))


def _closed(
    scan: RoomScan, observation: Observation, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    return scan, Setpoint()


_MOVES = {
    ScanPhase.TURN: _turn,
    ScanPhase.SEEK: _seek,
    ScanPhase.FACE: _face,
    ScanPhase.STAND_OFF: _stand_off,
    ScanPhase.SCAN: _scan,
    ScanPhase.CORNER: _corner,
    ScanPhase.SWEEP: _sweep,
    ScanPhase.BLOCKED: _blocked,
    ScanPhase.CLOSED: _closed,
}


def _refined(scan: RoomScan, observation: Observation) -> RoomScan:
    """Point at the wall as it is mapped by now rather than as the first turn saw it."""
    if observation.wall_ahead is None:
        return scan
    normal_rad, _ = observation.wall_ahead
    if abs(wrap_rad(normal_rad - scan.heading_rad)) > REFINEMENT_RAD:
        return scan
    return replace(scan, heading_rad=normal_rad)


def _on_heading(scan: RoomScan, observation: Observation) -> bool:
    return abs(wrap_rad(scan.heading_rad - observation.pose.yaw_rad)) < ON_HEADING_RAD


def _turn_rate(scan: RoomScan, observation: Observation, plan: MissionConfig) -> float:
    most_rad_s = math.radians(plan.turn_rate_deg_s)
    return turn_towards(scan.heading_rad, observation.pose.yaw_rad, most_rad_s)


def _wall_distance_m(scan: RoomScan, observation: Observation) -> float:
    """To the wall ahead: as mapped, if the front beam agrees, else as the beam says."""
    ahead_m = observation.clear_m(Beam.FRONT) * math.cos(
        observation.pose.yaw_rad - scan.heading_rad
    )
    if observation.wall_ahead is None:
        return ahead_m
    _, mapped_m = observation.wall_ahead
    return mapped_m if abs(mapped_m - ahead_m) < 0.5 else ahead_m


def _gap_m(scan: RoomScan, observation: Observation) -> float:
    """Along the wall, to the stand-off of the next."""
    return observation.clear_m(Beam.RIGHT) - scan.standoff_m


def _meets_wall(observation: Observation) -> bool:
    reading = observation.ranges.get(Beam.RIGHT)
    return reading is not None and reading.state in (RangeState.DISTANCE, RangeState.TOO_NEAR)


def _marked(scan: RoomScan, observation: Observation) -> RoomScan:
    here = observation.pose.ne_m
    if scan.marks and math.dist(scan.marks[-1].ne_m, here) < MARK_EVERY_M:
        return scan
    return replace(scan, marks=(*scan.marks, Mark(here, scan.heading_rad, scan.corners)))


def _is_closed(scan: RoomScan, observation: Observation) -> bool:
    """The walls behind were seen up to a mark a whole round ago, and from there on then."""
    for mark in scan.marks:
        if scan.corners - mark.corners < CORNERS_OF_A_ROOM:
            break
        north_m = observation.pose.north_m - mark.ne_m[0]
        east_m = observation.pose.east_m - mark.ne_m[1]
        _, along_m = ned_to_frd(north_m, east_m, mark.heading_rad)
        is_past = along_m > CLOSING_OVERLAP_M
        is_there = is_past and math.hypot(north_m, east_m) < CLOSING_WITHIN_M
        if is_there and abs(wrap_rad(scan.heading_rad - mark.heading_rad)) < CLOSING_RAD:
            return True
    return False


def _are_loose(walls: KnownWalls) -> bool:
    """It is not known well how far apart two that face one another are."""
    return float(walls.gap_sigmas_m().max(initial=0.0)) > LOOSE_M


def _guarded(speed_m_s: float, beam: Beam, observation: Observation) -> float:
    """Never on towards something near: the last word on every phase."""
    if speed_m_s <= 0:
        return speed_m_s
    return approach_speed(
        observation.clear_m(beam) - FULL_STOP_BEFORE_M, speed_m_s, observation.lag_s
    )

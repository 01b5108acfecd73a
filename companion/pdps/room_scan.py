"""State machine that traces one room: finds the nearest wall and flies round parallel to the walls.

            nothing returned          front returns
    TURN ─────────────────────► SEEK ─────────────► TURN
     │ nearest wall found
     ▼
    FACE ──► STAND_OFF ──► SCAN ──────────────────────────► CLOSED
    nose to    keep the    │ ▲ │ ▲   all corners turned, and
    the wall   distance    ▼ │ │ │   past the scan's beginning
                        CORNER ▼ │
                              SWEEP
    SEEK:   another drone of a team begins at a wall ─► FACE that wall
    CORNER: the right beam measures the next wall; turn 90° right
    SWEEP:  the path along the wall is not known to be free; sweep that side of it
    SCAN, still not known to be free after a sweep there ─► BLOCKED
    STAND_OFF, distance not reached within 30 s ─► BLOCKED
    SCAN, past its beginning ─► SCAN: an extra round, if the distances between walls are uncertain

The drone faces the wall and moves to its right. So it traces the room clockwise, and the right beam
points in the direction of flight. Of two drones of a team one moves to its left, until they meet
(`room_halves.py`). Meanwhile the nose swings, so that the beam sweeps the full width
of the path ahead. The swing is wide at the beginning of a leg, and small later.

Along a wall longer than the sensor's range, only odometry measures the distance between the walls
at its ends. If its sigma is too large after one round, the drone flies extra rounds. Each adds
another measurement.

Safety:

- The drone moves only forward and to the side of its round, where a beam points.
- Along the wall it moves only through space known to be free over the drone's width.
- It backs away from a wall only as far as the first turn measured free space.
- If a beam fails, the movement along that beam stops.
"""

import math
from dataclasses import replace

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2, frd_to_ned, moved, ned_to_frd, wrap_rad
from companion.core.known_walls import KnownWalls
from companion.core.messages import HOLD, Beam, RangeState, Setpoint
from companion.mapping.occupancy import Occupancy
from companion.navigation.observation import Observation
from companion.navigation.swing import Swing
from companion.pdps.perpendicular import TurnReading, find_perpendicular, free_distance
from companion.pdps.room_halves import divided, facing_other_wall, has_met, to_other_ne_m
from companion.pdps.room_scan_state import RoomScan, ScanPhase
from companion.safety.control_laws import (
    BODY_RADIUS_M,
    FULL_STOP_BEFORE_M,
    approach_speed,
    clamp,
    keep_distance,
    stay,
    turn_towards,
)

QUARTER_TURN_RAD = math.pi / 2
"""Angle between two walls of a room, and between the wall's normal and the flight along it."""
ON_HEADING_RAD = math.radians(2.5)
"""Maximum error at which a heading counts as reached, rad. Chosen."""
ROUND_CORNER_RAD = math.radians(15)
"""Remaining turn at a corner from which the drone already moves along the next wall, rad. Chosen:
the right beam points along it by then."""
AT_STANDOFF_M = 0.10
"""Maximum error at which the stand-off counts as reached, m. Chosen."""
STANDOFF_WITHIN_S = 30.0
"""Timeout of STAND_OFF, s. Chosen: after it, something keeps the drone off the stand-off."""
SEEN_BY_ONE_TURN_M = 3.0
"""Maximum distance for which one turn counts as proof of free space, m. Chosen."""
MIN_ROOM_BEHIND_M = 0.7
"""Distance behind that stays free when the drone backs away from a wall, m. Chosen."""
SEEK_UNTIL_M = 4.0
"""SEEK ends when the front beam measures less than this or the stand-off, m. Chosen."""
CORNER_READINGS = 2
"""Number of consecutive readings that detect a corner. Chosen."""
CORNER_MARGIN_M = 0.12
"""Remaining distance to the next wall's stand-off at which a corner is detected, m. Chosen."""
REFINEMENT_RAD = math.radians(30)
"""Maximum correction of the heading in one tick, rad. Chosen: a step of the pose can turn the map
by this much, while the stored heading stays."""
KNOWN_AHEAD_M = 1.3
"""Length of the path along the wall, from the drone's centre, that must be known to be free, m.
With less, the drone sweeps first. Chosen."""
HALF_WAY_M = 0.5
"""Half width of that path, m. Chosen."""
SWEEP_RAD, ON_SWEEP_RAD = math.radians(70), math.radians(5)
"""Angle of a sweep to one side, and error at which it counts as reached, rad. Chosen: the beam
then sweeps all of the path from about 0.1 m before the drone."""
SWEPT_WITHIN_M = 0.25
"""A second sweep nearer to the last one than this ends the scan, m. Chosen."""
LOOSE_M, MAX_EXTRA_ROUNDS = 0.06, 2
"""Minimum sigma of the distance between two walls that justifies an extra round, m, and maximum
number of extra rounds. Chosen."""

_TURNING = (Beam.FRONT, Beam.RIGHT, Beam.LEFT)
"""Beams that detect the nearest wall in the first turn."""


def step(
    scan: RoomScan, observation: Observation, space: Occupancy, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    """Runs one tick. Returns the next state and the velocity setpoint."""
    standoff_m = min(observation.standoff_m, scan.most_standoff_m)
    if standoff_m != scan.standoff_m:
        scan = replace(scan, standoff_m=standoff_m)
    if scan.phase is ScanPhase.SCAN and (sides := _unknown_sides(scan, observation, space)):
        scan = _begin_sweep(scan, observation, sides)
    scan, setpoint = _MOVES[scan.phase](scan, observation, plan)
    return scan, Setpoint(
        _guarded(setpoint.forward_m_s, Beam.FRONT, observation),
        scan.side * _guarded(scan.side * setpoint.right_m_s, scan.ahead, observation),
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
    nearest = find_perpendicular(scan.turn, to_other_ne_m(observation))
    bearing_rad = nearest.bearing_rad if nearest else None
    if (other := facing_other_wall(scan, bearing_rad, observation)) is not None:
        return other, Setpoint()
    if nearest is None:
        return RoomScan(ScanPhase.SEEK, side=scan.side, heading_rad=yaw_rad), Setpoint()
    behind_m = free_distance(scan.turn, nearest.bearing_rad + math.pi, SEEN_BY_ONE_TURN_M)
    may_back_m = max(behind_m - MIN_ROOM_BEHIND_M, 0.0)
    faced = RoomScan(
        phase=ScanPhase.FACE,
        side=scan.side,
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
    if (other := facing_other_wall(scan, None, observation)) is not None:
        return other, Setpoint()
    ahead_m = observation.clear_m(Beam.FRONT)
    if ahead_m < max(SEEK_UNTIL_M, observation.standoff_m):
        return RoomScan(side=scan.side), Setpoint()
    yaw_rate = _turn_rate(scan, observation, plan)
    return scan, Setpoint(forward_m_s=0.5 * plan.speed_m_s, yaw_rate_rad_s=yaw_rate)


def _face(
    scan: RoomScan, observation: Observation, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    scan = _refined(scan, observation)
    if (other := facing_other_wall(scan, scan.heading_rad, observation)) is not None:
        return other, Setpoint()
    if _on_heading(scan, observation):
        return replace(scan, phase=ScanPhase.STAND_OFF, faced_s=observation.pose.time_s), Setpoint()
    return scan, Setpoint(yaw_rate_rad_s=_turn_rate(scan, observation, plan))


def _stand_off(
    scan: RoomScan, observation: Observation, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    scan = divided(_refined(scan, observation), observation)
    if (other := facing_other_wall(scan, scan.heading_rad, observation)) is not None:
        return other, Setpoint()
    distance_m = _wall_distance_m(scan, observation)
    if abs(distance_m - scan.standoff_m) < AT_STANDOFF_M and _on_heading(scan, observation):
        return replace(scan, phase=ScanPhase.SCAN, swing=Swing(scan.side)), Setpoint()
    if observation.pose.time_s - scan.faced_s > STANDOFF_WITHIN_S:
        return replace(scan, phase=ScanPhase.BLOCKED), Setpoint()
    forward = keep_distance(distance_m, scan.standoff_m, 0.7 * plan.speed_m_s)
    return scan, Setpoint(forward, yaw_rate_rad_s=_turn_rate(scan, observation, plan))


def _scan(
    scan: RoomScan, observation: Observation, plan: MissionConfig
) -> tuple[RoomScan, Setpoint]:
    scan = _refined(scan, observation).marked(observation.pose.ne_m)
    if has_met(scan, observation, _gap_m(scan, observation)):
        return replace(scan, phase=ScanPhase.CLOSED), Setpoint()
    if scan.is_closed(observation.pose.ne_m):
        if scan.extra_rounds == MAX_EXTRA_ROUNDS or not _are_loose(observation.walls()):
            return replace(scan, phase=ScanPhase.CLOSED), Setpoint()
        scan = replace(scan, extra_rounds=scan.extra_rounds + 1, marks=scan.marks[-1:])
    gap_m = _gap_m(scan, observation)
    met = _meets_wall(scan, observation) and gap_m < CORNER_MARGIN_M
    corner_readings = scan.corner_readings + 1 if met else 0
    if corner_readings != scan.corner_readings:
        scan = replace(scan, corner_readings=corner_readings)
    if scan.corner_readings >= CORNER_READINGS:
        turned = replace(
            scan,
            phase=ScanPhase.CORNER,
            heading_rad=wrap_rad(scan.heading_rad + scan.side * QUARTER_TURN_RAD),
            corner_readings=0,
            corner_ne_m=_along_m(scan, observation, gap_m),
        )
        return turned, Setpoint()
    along_rad = wrap_rad(_along_rad(scan) - observation.pose.yaw_rad)
    off_rad = wrap_rad(observation.pose.yaw_rad - scan.heading_rad)
    scan = replace(scan, swing=scan.swing.onward(off_rad, observation.lane(along_rad)))
    along = _along_wall(scan, observation, plan)
    swings_rad_s = clamp(scan.swing.rate_rad_s, math.radians(plan.turn_rate_deg_s))
    return scan, replace(along, yaw_rate_rad_s=swings_rad_s)


def _along_rad(scan: RoomScan) -> float:
    """Bearing of the flight along the wall, rad."""
    return scan.heading_rad + scan.side * QUARTER_TURN_RAD


def _along_m(scan: RoomScan, observation: Observation, along_m: float) -> Vector2:
    """Place at a distance along the wall from the drone, local NED, m."""
    return moved(observation.pose.ne_m, (0.0, scan.side * along_m), scan.heading_rad)


def _along_wall(scan: RoomScan, observation: Observation, plan: MissionConfig) -> Setpoint:
    """Setpoint along the wall at the stand-off, up to the stand-off of the next wall."""
    wall_m = _wall_distance_m(scan, observation)
    towards_m_s = keep_distance(wall_m, scan.standoff_m, 0.4 * plan.speed_m_s)
    along_m_s = approach_speed(_gap_m(scan, observation), plan.speed_m_s, observation.lag_s)
    off_rad = wrap_rad(observation.pose.yaw_rad - scan.heading_rad)
    return Setpoint(*ned_to_frd(towards_m_s, scan.side * along_m_s, off_rad))


def _unknown_sides(scan: RoomScan, observation: Observation, space: Occupancy) -> list[int]:
    """Sides of the path along the wall where too little is known to be free.

    1 is the side towards the wall, -1 the other. Required are `KNOWN_AHEAD_M`, or less if the next
    wall is nearer. A sweep does not cover what lies beside the drone.
    """
    along_rad = _along_rad(scan)
    enough_m = min(KNOWN_AHEAD_M, _gap_m(scan, observation) + BODY_RADIUS_M)
    unknown = []
    for side in (1, -1):
        off = frd_to_ned(side * 0.5 * HALF_WAY_M, scan.side * BODY_RADIUS_M, scan.heading_rad)
        middle = observation.pose.north_m + off[0], observation.pose.east_m + off[1]
        known_m = space.known_free_m(middle, along_rad, 0.5 * HALF_WAY_M, KNOWN_AHEAD_M)
        if BODY_RADIUS_M + known_m < enough_m:
            unknown.append(side)
    return unknown


def _begin_sweep(scan: RoomScan, observation: Observation, sides: list[int]) -> RoomScan:
    """Begins turns by which the beam ahead sweeps the unknown sides, and the turn back.

    If the last sweep was here, too, the scan ends.
    """
    here = observation.pose.ne_m
    if scan.swept_ne_m is not None and math.dist(here, scan.swept_ne_m) < SWEPT_WITHIN_M:
        return replace(scan, phase=ScanPhase.CLOSED if scan.is_extra else ScanPhase.BLOCKED)
    aside = tuple(scan.heading_rad - scan.side * side * SWEEP_RAD for side in sides)
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
        scan = replace(scan, phase=ScanPhase.SCAN, corners=corners, swing=Swing(scan.side))
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
    """Corrects the heading to the mapped wall ahead, which is more exact than the first turn."""
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
    """Distance to the wall ahead, m: from the map, or from the front beam if the two disagree."""
    ahead_m = observation.clear_m(Beam.FRONT) * math.cos(
        observation.pose.yaw_rad - scan.heading_rad
    )
    if observation.wall_ahead is None:
        return ahead_m
    _, mapped_m = observation.wall_ahead
    return mapped_m if abs(mapped_m - ahead_m) < 0.5 else ahead_m


def _gap_m(scan: RoomScan, observation: Observation) -> float:
    """Distance along the wall to the stand-off of the next wall, m."""
    return observation.clear_m(scan.ahead) - scan.standoff_m


def _meets_wall(scan: RoomScan, observation: Observation) -> bool:
    reading = observation.ranges.get(scan.ahead)
    return reading is not None and reading.state in (RangeState.DISTANCE, RangeState.TOO_NEAR)


def _are_loose(walls: KnownWalls) -> bool:
    """True if the distance between two opposite walls has a sigma over `LOOSE_M`."""
    return float(walls.gap_sigmas_m().max(initial=0.0)) > LOOSE_M


def _guarded(speed_m_s: float, beam: Beam, observation: Observation) -> float:
    """Limits the speed along a beam by the distance it measures, in every phase."""
    if speed_m_s <= 0:
        return speed_m_s
    return approach_speed(
        observation.clear_m(beam) - FULL_STOP_BEFORE_M, speed_m_s, observation.lag_s
    )

"""The state that a drone tells its teammates, from the state of its flight."""

import math

import numpy as np

from companion.core.frames import Vector2, wrap_rad
from companion.core.messages import Pose
from companion.navigation.doorway_claims import claimed
from companion.pdps.explore import ExplorePhase
from companion.pdps.flight.state import COLUMN_PHASES, FLYING_PHASES, FlightState, Phase
from companion.pdps.layers import LayersPhase
from companion.pdps.room_scan_state import ScanPhase
from companion.team.messages import MAX_PLACES, State, Track, pack_floats

DOWN_M = 0.4
"""A drone that lands is below all others under this height, m. Chosen: the lowest height of a
mission, less the distance in height."""
LINE_STEP_M = 0.6
"""Spacing of the places on the way of an overflight, m. Chosen: less than what it covers."""
WORKING_PHASES = FLYING_PHASES - {Phase.HOME, Phase.DIVERT, Phase.DESCEND}
"""Phases in which the drone has a layer."""


def track_of(flight: FlightState) -> Track:
    """The round of the room that this drone has flown."""
    scan = flight.room
    places = np.array([mark.ne_m for mark in scan.marks]).reshape(-1, 2)
    begins_rad = scan.marks[0].heading_rad if scan.marks else scan.heading_rad
    has_wall = scan.phase not in (ScanPhase.TURN, ScanPhase.SEEK)
    wall_rad = wrap_rad(begins_rad) if has_wall else None
    side = scan.side if scan.marks else 0
    return Track(
        wall_rad, side, flight.phase is Phase.ROOM and scan.is_tracing, pack_floats(places)
    )


def layer_of(flight: FlightState) -> int | None:
    """The layer in which the drone works, or to which it climbs; None before and after."""
    return flight.layers.number if flight.phase in WORKING_PHASES else None


def needs_column(flight: FlightState, height_m: float) -> bool:
    """True while the drone climbs or descends, and is not yet below all others."""
    is_down = flight.phase is Phase.LAND and height_m < DOWN_M
    climbs = flight.phase is Phase.LAYERS and flight.layers.phase is LayersPhase.CLIMB
    return (flight.phase in COLUMN_PHASES and not is_down) or climbs


def state_of(
    flight: FlightState,
    pose: Pose,
    velocity_ne_m_s: Vector2,
    *,
    battery: float | None,
    received: dict[int, int],
    links: dict[int, int],
) -> State:
    """The state of this drone.

    `received`: number of map pieces that it has of each teammate. `links`: number of radio links to
    each teammate that it reaches.
    """
    explores = flight.explores
    look = explores.look if explores and explores.phase is not ExplorePhase.DONE else None
    in_column = needs_column(flight, pose.height_m)
    target = _thinned(look.at_ne_m) if look else _flies_over(flight, pose)
    return State(
        pose.ne_m,
        pose.height_m,
        pose.yaw_rad,
        velocity_ne_m_s,
        pose.position_sigma_m,
        flight.phase.value,
        flight.phase in FLYING_PHASES or in_column,
        in_column,
        flight.waits,
        1.0 if battery is None else min(max(battery, 0.0), 1.0),
        target,
        flight.layers.is_extra if look is None else look.is_extra,
        max(explores.arrives_s - pose.time_s, 0.0) if explores and look else 0.0,
        received,
        layer_of(flight),
        tuple(sorted(flight.layers.seen)),
        _doorway_ne_m(flight, pose),
        links,
    )


def _doorway_ne_m(flight: FlightState, pose: Pose) -> Vector2 | None:
    """The doorway that the drone claims; None while it lets a teammate pass below."""
    if flight.travel is None or flight.passing is not None:
        return None
    doorway = claimed(flight.travel, pose.ne_m)
    return doorway.middle_ne_m if doorway else None


def _flies_over(flight: FlightState, pose: Pose) -> tuple[Vector2, ...]:
    """Places on the straight line to the goal of an overflight; none without one."""
    travel = flight.layers.overfly.travel
    if flight.phase is not Phase.LAYERS or not flight.layers.is_extra or travel is None:
        return ()
    steps = 2 + round(math.dist(pose.ne_m, travel.goal_ne_m) / LINE_STEP_M)
    line = np.linspace(pose.ne_m, travel.goal_ne_m, min(steps, MAX_PLACES))
    return tuple((north_m, east_m) for north_m, east_m in line.tolist())


def _thinned(places: tuple[Vector2, ...]) -> tuple[Vector2, ...]:
    """At most `MAX_PLACES` of the places, evenly."""
    step = -(-len(places) // MAX_PLACES)
    return places[::step] if step > 1 else places

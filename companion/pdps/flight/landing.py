"""From the end of a mission to the ground: home, or where it can land instead."""

import math
from dataclasses import replace

from companion.config.settings import MissionConfig
from companion.core.messages import HOLD, Beam, Command, CommandKind, LandedState
from companion.navigation import travel
from companion.navigation.grid_planner import START_NE_M
from companion.navigation.landing_site import landing_site
from companion.navigation.travel_state import Travel, TravelPhase
from companion.pdps.flight.ground import AT_HEIGHT_M
from companion.pdps.flight.state import (
    LEVEL_PHASES,
    LINK_LOST_S,
    NOTHING,
    FlightAction,
    FlightState,
    Phase,
    TickInput,
    after,
    age_s,
    go,
    hand_over,
)
from companion.safety.control_laws import stay

DISARMED_BY_S = 10.0
"""An autopilot that stands on the ground disarms by itself; by then it is asked to."""
SETTLES_S, OVER_START_M = 4.0, 0.1
"""Before it lands the drone comes to rest over its start: at most so long, and at least half of
that, the time that ArduCopter 4.6 needs to stop (docs/autopilot.md)."""
LAND_FROM_M = 0.35
"""Height down to which the companion lowers the drone over its start: in LAND PX4 moves sideways
by up to 0.5 m from 1 m down (docs/autopilot.md). Below 0.2 m flow sensors see little."""
DESCENT_TIMEOUT_S = 8.0
"""Three times what it takes from a height of 1.2 m; then it lands from where it is."""
LOOKS_FOR_WAY_HOME_S = 60.0
"""So long it looks anew for a way home that it has not found: somebody who stood there may go, and
what was drawn amiss is drawn anew by a look all round, which takes 10 to 20 s. Chosen: three."""
DIVERTS_S = 30.0
"""Then it lands where it is: 5 % of what flies for ten minutes."""
TELLS_FLOOR_FROM_M, FLOOR_OFF_M = 0.75, 0.25
"""From the first height up the down beam tells floor, to within the second, from a table. A table
top 0.4 m below a Sharp sensor reads as floor does 1.1 m below; 5 cm lower it reads half a metre
more, and the floor 5 cm less."""
LOOKS_AGAIN_S = 5.0
"""It waits so long before: to find that there is none takes the computer some tens of ms."""
MAY_DIVERT_PHASES = LEVEL_PHASES - {Phase.DIVERT, Phase.DESCEND}
LOOKS_AGAIN = "no way back to the start was found; it looks again"
NO_WAY_HOME = "there is no way back to the start any more"


def home(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    homeward = flight.way_home
    if homeward.phase is TravelPhase.ARRIVED:
        return _settle(flight, view)
    if not homeward.known:
        homeward = replace(homeward, known=flight.building.known_doorways)
    if homeward.phase is TravelPhase.GAVE_UP:
        return _look_for_way_home(flight, view, plan), FlightAction(HOLD)
    going, setpoint = travel.step(homeward, view.observation, view.space, plan)
    flight = replace(flight, way_home=going)
    match going.phase:
        case TravelPhase.ARRIVED:
            return replace(flight, arrived_s=view.time_s), FlightAction(
                stay(START_NE_M, view.observation.pose)
            )
        case TravelPhase.GAVE_UP:
            since_s = min(flight.lost_since_s, view.time_s)
            return replace(flight, lost_since_s=since_s, lost_s=view.time_s), FlightAction(HOLD)
        case _:
            return flight, FlightAction(setpoint)


def _look_for_way_home(flight: FlightState, view: TickInput, plan: MissionConfig) -> FlightState:
    """Anew, as if none of the ways had been tried; in the end it lands elsewhere."""
    if view.time_s - flight.lost_since_s > LOOKS_FOR_WAY_HOME_S:
        return land_elsewhere(flight, view, plan, NO_WAY_HOME)
    if view.time_s - flight.lost_s < LOOKS_AGAIN_S:
        return flight
    return replace(flight, way_home=Travel(START_NE_M), notice=LOOKS_AGAIN)


def land_elsewhere(
    flight: FlightState, view: TickInput, plan: MissionConfig, why: str
) -> FlightState:
    """On floor that it has flown over nearby, if there is any and it has room to fly there."""
    if flight.phase not in MAY_DIVERT_PHASES:
        return go(flight, Phase.LAND, view, why)
    return _divert_to_floor(replace(flight, trouble=why), view, plan)


def _divert_to_floor(flight: FlightState, view: TickInput, plan: MissionConfig) -> FlightState:
    here = view.observation.pose.ne_m
    site = landing_site(here, view.space, view.floor, plan)
    if site == here:
        return go(flight, Phase.LAND, view)
    since_s = min(flight.diverted_s, view.time_s)
    return go(replace(flight, diversion=Travel(site), diverted_s=since_s), Phase.DIVERT, view)


def divert(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    assert flight.diversion is not None
    going, setpoint = travel.step(flight.diversion, view.observation, view.space, plan)
    flight = replace(flight, diversion=going)
    if going.phase is TravelPhase.ARRIVED:
        return go(flight, Phase.DESCEND, view), FlightAction(HOLD)
    if going.phase is TravelPhase.GAVE_UP or view.time_s - flight.diverted_s > DIVERTS_S:
        return go(flight, Phase.LAND, view), FlightAction(HOLD)
    return flight, FlightAction(setpoint)


def _settle(flight: FlightState, view: TickInput) -> tuple[FlightState, FlightAction]:
    """Come to rest over the start: an autopilot that is told to land goes on by half a metre."""
    pose = view.observation.pose
    is_over = math.dist(pose.ne_m, START_NE_M) < OVER_START_M
    waited_s = view.time_s - flight.arrived_s
    if waited_s > SETTLES_S or (is_over and waited_s > 0.5 * SETTLES_S):
        flight = go(flight, after(Phase.DESCEND, view), view)
    return flight, FlightAction(stay(START_NE_M, pose))


def descend(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    if flight.diversion is not None and _is_table_below(view):
        return _divert_to_floor(flight, view, plan), FlightAction(HOLD)
    is_low = view.observation.pose.height_m < LAND_FROM_M + AT_HEIGHT_M
    if is_low or age_s(flight, view) > DESCENT_TIMEOUT_S:
        return go(flight, Phase.LAND, view), FlightAction(HOLD)
    over_ne_m = flight.diversion.goal_ne_m if flight.diversion else START_NE_M
    return flight, FlightAction(stay(over_ne_m, view.observation.pose))


def _is_table_below(view: TickInput) -> bool:
    """What the down beam meets is not floor; the floor nearer than half a metre is not told."""
    height_m, reading = view.observation.pose.height_m, view.observation.ranges.get(Beam.DOWN)
    if reading is None or not reading.is_distance or height_m < TELLS_FLOOR_FROM_M:
        return False
    return abs(height_m - view.observation.mount_offset_m - reading.distance_m) > FLOOR_OFF_M


def land(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    vehicle = view.vehicle
    if max(vehicle.silent_s, vehicle.mode_age_s) > LINK_LOST_S:
        trouble = f"{flight.trouble or 'link lost while landing'}; nothing heard for 10 s"
        return go(flight, Phase.FAILED, view, trouble), NOTHING
    if vehicle.is_silent or not vehicle.is_mode_recent:
        return flight, NOTHING  # somebody else may have it by now
    if not vehicle.armed:
        return go(flight, Phase.DONE, view), NOTHING
    if vehicle.mode == "LAND":
        stands = vehicle.landed_state is LandedState.ON_GROUND
        disarm = stands and age_s(flight, view) > DISARMED_BY_S
        command = Command(CommandKind.DISARM) if disarm else None
        return replace(flight, land_mode_seen=True), FlightAction(command=command)
    gave_back = vehicle.in_offboard_mode and vehicle.left_offboard
    if flight.land_mode_seen or gave_back or not vehicle.in_offboard_mode:
        return hand_over(flight, view), NOTHING
    return flight, FlightAction(command=Command(CommandKind.LAND))

"""Steps of the phases from the end of a mission to the ground: home, or another landing site."""

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
"""Time in LAND after which the companion requests disarming on the ground, s. Chosen: autopilots
disarm by themselves before."""
SETTLES_S, OVER_START_M = 4.0, 0.1
"""Maximum time to come to rest over the start before the descent, s, and maximum distance from it,
m. Half of the time is the minimum: ArduCopter 4.6 needs it to stop (docs/autopilot.md)."""
LAND_FROM_M = 0.35
"""Height at which the companion's descent ends and LAND begins, m. In LAND, PX4 moves sideways by
up to 0.5 m from 1 m down (docs/autopilot.md). Below 0.2 m flow sensors measure little."""
DESCENT_TIMEOUT_S = 8.0
"""Timeout of the descent, s; after it the drone lands from its present height. Three times the
duration from a height of 1.2 m."""
LOOKS_FOR_WAY_HOME_S = 60.0
"""Timeout of the search for a path home, s. A person in the way may leave, and a sweep all round,
which takes 10 to 20 s, corrects the map. Chosen: three sweeps."""
DIVERTS_S = 30.0
"""Timeout of a diversion, s; after it the drone lands where it is. 5 % of a flight of 600 s."""
TELLS_FLOOR_FROM_M, FLOOR_OFF_M = 0.75, 0.25
"""Minimum height at which the down beam distinguishes floor from a table, and the tolerance for
floor, m. A table top 0.4 m below a Sharp sensor reads as floor 1.1 m below does. When the drone is
0.05 m lower, the table top reads 0.5 m more, and the floor 0.05 m less."""
LOOKS_AGAIN_S = 5.0
"""Pause between two searches for a path home, s. Chosen: a search that fails takes some tens of
ms of computing time."""
MAY_DIVERT_PHASES = LEVEL_PHASES - {Phase.DIVERT, Phase.DESCEND}
"""Phases from which a diversion can begin."""
LOOKS_AGAIN = "no way back to the start was found; searching again"
"""Notice while the search for a path home continues."""
NO_WAY_HOME = "there is no way back to the start any more"
"""Trouble after the timeout of that search."""


def home(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """HOME: flies to the start and comes to rest there."""
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
    """Searches a path home again, from a fresh state. After the timeout it lands elsewhere."""
    if view.time_s - flight.lost_since_s > LOOKS_FOR_WAY_HOME_S:
        return land_elsewhere(flight, view, plan, NO_WAY_HOME)
    if view.time_s - flight.lost_s < LOOKS_AGAIN_S:
        return flight
    return replace(flight, way_home=Travel(START_NE_M), notice=LOOKS_AGAIN)


def land_elsewhere(
    flight: FlightState, view: TickInput, plan: MissionConfig, why: str
) -> FlightState:
    """Lands on floor nearby that the drone has flown over, if it can reach any; else right here."""
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
    """DIVERT: flies to the landing site."""
    assert flight.diversion is not None
    going, setpoint = travel.step(flight.diversion, view.observation, view.space, plan)
    flight = replace(flight, diversion=going)
    if going.phase is TravelPhase.ARRIVED:
        return go(flight, Phase.DESCEND, view), FlightAction(HOLD)
    if going.phase is TravelPhase.GAVE_UP or view.time_s - flight.diverted_s > DIVERTS_S:
        return go(flight, Phase.LAND, view), FlightAction(HOLD)
    return flight, FlightAction(setpoint)


def _settle(flight: FlightState, view: TickInput) -> tuple[FlightState, FlightAction]:
    """Comes to rest over the start: in LAND a moving drone continues by 0.5 m."""
    pose = view.observation.pose
    is_over = math.dist(pose.ne_m, START_NE_M) < OVER_START_M
    waited_s = view.time_s - flight.arrived_s
    if waited_s > SETTLES_S or (is_over and waited_s > 0.5 * SETTLES_S):
        flight = go(flight, after(Phase.DESCEND, view), view)
    return flight, FlightAction(stay(START_NE_M, pose))


def descend(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """DESCEND: descends over the start or the landing site, to `LAND_FROM_M`."""
    if flight.diversion is not None and _is_table_below(view):
        return _divert_to_floor(flight, view, plan), FlightAction(HOLD)
    is_low = view.observation.pose.height_m < LAND_FROM_M + AT_HEIGHT_M
    if is_low or age_s(flight, view) > DESCENT_TIMEOUT_S:
        return go(flight, Phase.LAND, view), FlightAction(HOLD)
    over_ne_m = flight.diversion.goal_ne_m if flight.diversion else START_NE_M
    return flight, FlightAction(stay(over_ne_m, view.observation.pose))


def _is_table_below(view: TickInput) -> bool:
    """True if the down beam measures something else than floor. Below 0.75 m it is always False."""
    height_m, reading = view.observation.pose.height_m, view.observation.ranges.get(Beam.DOWN)
    if reading is None or not reading.is_distance or height_m < TELLS_FLOOR_FROM_M:
        return False
    return abs(height_m - view.observation.mount_offset_m - reading.distance_m) > FLOOR_OFF_M


def land(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """LAND: commands the landing, and ends the flight when the vehicle is disarmed."""
    vehicle = view.vehicle
    if max(vehicle.silent_s, vehicle.mode_age_s) > LINK_LOST_S:
        trouble = f"{flight.trouble or 'link lost while landing'}; no message for 10 s"
        return go(flight, Phase.FAILED, view, trouble), NOTHING
    if vehicle.is_silent or not vehicle.is_mode_recent:
        return flight, NOTHING  # another party may have control by now
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

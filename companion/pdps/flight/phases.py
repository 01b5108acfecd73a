"""State machine of the whole flight, from the first HEARTBEAT to the last.

                                                  ┌─► ROOM ─────┐
    CONNECT ─► PREPARE ─► OFFBOARD ─► ARM ─► TAKE_OFF            ├─► HOME ─► DESCEND ─► LAND ─► DONE
                                                 │└─► BUILDING ─┘    │          │         ▲
                                                 └────────┬──────────┴──────────┘         │
                                                fault     ▼           fault lasts         │
                                                         HOLD ────────────────────────────┘
                                                          │
                                                          │ fault gone: back to the phase before
                                                          ▼
    with the orders of a script: PREPARE waits for the order to take off; TAKE_OFF, the missions,
    FLY_TO, FLY_VELOCITY and HOME end in HOVER, which goes to one of these or LAND by order
    (`orders.py`)

    the missions, in a team:       a teammate with the right of way is
                                   not heard                           ─► the drone holds its place
    every phase at height, in a team: the map contradicts the others',
                                   or it is time for another to fly on ─► DIVERT or LAND
    the missions and orders, HOME: time or battery limit, no path home  ─► DIVERT if there is
                                                                           floor nearby, or LAND
    DIVERT:                        over floor that it has flown over    ─► DESCEND
                                   no path there, or timeout            ─► LAND
    DESCEND, not over its start:   below is not floor                   ─► DIVERT, or LAND
    TAKE_OFF, DESCEND, HOLD:       time or battery limit                ─► LAND
    every phase in the air:        pilot or autopilot leaves our mode   ─► HANDED_OVER
                                   autopilot disarms                    ─► FAILED
                                   nothing received for 10 s            ─► FAILED
    before arming:                 the program must end                 ─► FAILED
                                   another party arms the vehicle, or
                                   sends with our ID; battery low       ─► FAILED
    OFFBOARD, ARM:                 another party changes the mode       ─► HANDED_OVER
    LAND:                          any mode but ours and LAND           ─► HANDED_OVER
    before take-off:               timeout: no autopilot, no estimate,
                                   a fault, arming refused              ─► FAILED

Safety:

- Setpoints are sent in TAKE_OFF (PX4), the missions, FLY_TO, FLY_VELOCITY, HOME, DIVERT, DESCEND,
  HOVER and HOLD: while the vehicle is armed and in the requested mode. Before, in OFFBOARD and ARM,
  they have zero velocity, and show PX4 that a companion is present.
- After the companion has requested its mode, any change to another mode comes from the pilot or the
  autopilot. Then the companion stops sending at once and for good, even if the mode returns. This
  includes PX4's LAND after late setpoints: more setpoints would return it to OFFBOARD.
- The companion flies only a vehicle that its own command armed.
- Each command is sent directly after a HEARTBEAT that shows who has control: once a second, and
  never while the link is silent. Only the request for the mode is also sent in between.
- HOLD sends zero velocity. If the link is lost, the autopilot stops by its own setpoint timeout.
- DONE, HANDED_OVER and FAILED are final.
"""

import math
from dataclasses import replace

from companion.config.settings import MissionConfig
from companion.core.messages import HOLD, STALE, Beam, Setpoint, VehicleState
from companion.navigation import energy_reserve
from companion.navigation.energy_reserve import Spent
from companion.navigation.grid_planner import START_NE_M
from companion.navigation.travel import in_the_open
from companion.navigation.travel_state import Travel
from companion.pdps import explore, layers, room_scan
from companion.pdps.claims import is_more_expected
from companion.pdps.explore import ExplorePhase
from companion.pdps.flight import orders
from companion.pdps.flight.ground import arm, connect, not_to_be_armed, offboard, prepare, take_off
from companion.pdps.flight.landing import LAND_FROM_M, descend, divert, home, land, land_elsewhere
from companion.pdps.flight.state import (
    FINAL_PHASES,
    FLYING_PHASES,
    HEARTBEAT_S,
    LEVEL_PHASES,
    LINK_LOST_S,
    MISSION_PHASES,
    NOTHING,
    TASK_PHASES,
    UNARMED_PHASES,
    FlightAction,
    FlightState,
    Phase,
    PhaseStep,
    TickInput,
    after,
    age_s,
    go,
    hand_over,
)
from companion.pdps.layers import LayersPhase
from companion.pdps.left_unseen import in_words, left_unseen
from companion.pdps.room_scan_state import ScanPhase
from companion.safety import fence
from companion.safety.control_laws import (
    BODY_RADIUS_M,
    CLIMB_LAG_S,
    MAX_CLIMB_M_S,
    approach_speed,
    climb_to,
    stay,
)
from companion.safety.separation import passing_from
from companion.safety.velocity_guard import guarded

ABOVE_LEVEL_M = 0.2
"""Above the height of the layer by more than this, the drone does not fly on, m. Chosen."""
AT_EDGE_M = 0.1
"""So near to the fence a scan of a room ends, m. Chosen: the guard hardly lets it go on."""
LANDING_SHARE = 0.5
"""Share of `mission.reserve_s` in which a drone can land. Chosen: 10 s by default."""
BEYOND_FENCE = "the walls lead beyond mission.max_distance_m; exploring what is within it"
"""Notice when a scan of a room ends at the fence."""


def step(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """Runs one tick. Returns the next state and the action for the autopilot."""
    if flight.phase in FINAL_PHASES:
        return flight, NOTHING
    if math.isinf(flight.since_s):
        flight = replace(flight, since_s=view.time_s)
    if ended := _ended(flight, view, plan):
        return ended, NOTHING
    if flight.phase in FLYING_PHASES and (cut_short := _cut_short(flight, view, plan)):
        flight = cut_short
    if flight.phase in TASK_PHASES:
        flight = _in_time(flight, view, plan)
    step_of_phase = _step_of(flight, view)
    if flight.holds_at_ne_m and step_of_phase is not _hold_place:
        flight = flight.rested()
    flight, action = step_of_phase(flight, view, plan)
    if action.setpoint is not None and flight.phase in LEVEL_PHASES:
        flight, wanted = _let_pass(flight, view, plan, action.setpoint)
        level = replace(wanted, down_m_s=_climb(flight, view, plan))
        safe = guarded(level, view.around, plan.clearance_m)
        flight, action = orders.note_limits(flight, view, safe), replace(action, setpoint=safe)
    return flight, action if _may_ask(flight, view.vehicle) else replace(action, command=None)


def _step_of(flight: FlightState, view: TickInput) -> PhaseStep:
    """The step of the phase, or what comes before it."""
    if _must_hold_place(flight, view):
        return _hold_place
    return orders.comes_first(flight, view) or _STEPS[flight.phase]


def _may_ask(flight: FlightState, vehicle: VehicleState) -> bool:
    """True if a command may be sent now: in OFFBOARD also between two HEARTBEATs."""
    if flight.phase is Phase.OFFBOARD:
        return vehicle.mode_age_s <= HEARTBEAT_S
    return vehicle.is_mode_recent


def _ended(flight: FlightState, view: TickInput, plan: MissionConfig) -> FlightState | None:
    """The ended flight, if another party has control or the program must end before take-off."""
    if flight.phase in FLYING_PHASES:
        return _taken_away(flight, view)
    if flight.phase not in UNARMED_PHASES:
        return None
    if view.land_requested and not view.vehicle.armed:
        return go(flight, Phase.FAILED, view, "it was to end before it took off")
    return None if flight.phase is Phase.CONNECT else not_to_be_armed(flight, view, plan)


def _let_pass(
    flight: FlightState, view: TickInput, plan: MissionConfig, wanted: Setpoint
) -> tuple[FlightState, Setpoint]:
    """Stays at the place while the drone is above a teammate, and until it is down again.

    Above the height of the mission the map is not valid, such as under a lintel.
    """
    observation, level_m = view.observation, flight.layers.height_m(plan)
    pose, up = observation.pose, observation.ranges.get(Beam.UP, STALE)
    passing = flight.passing
    if passing is not None:
        is_above = pose.height_m > level_m + ABOVE_LEVEL_M
        is_over = not (view.around.lets_pass or is_above) or _changes_height(flight)
        passing = None if is_over else passing.see(pose, up, observation.mount_offset_m)
    elif _may_let_pass(flight, view):
        mount_m = observation.mount_offset_m
        passing = passing_from(
            pose, up, mount_m, level_m, plan.clearance_m, top_m=fence.top_m(plan)
        )
    if passing is not flight.passing:
        flight = replace(flight, passing=passing)
    if passing is None:
        return flight, wanted
    staying = stay(passing.at_ne_m, pose)
    return flight, replace(staying, yaw_rate_rad_s=wanted.yaw_rate_rad_s)


def _may_let_pass(flight: FlightState, view: TickInput) -> bool:
    """True if the drone may climb now: not in a doorway, nor near anything that hangs low."""
    wanted = view.around.lets_pass and not _changes_height(flight)
    return wanted and view.around.may_climb and in_the_open(view.observation, view.space)


def _changes_height(flight: FlightState) -> bool:
    """True if the drone descends, climbs to another layer, or changes its height by order."""
    climbs = flight.phase is Phase.LAYERS and flight.layers.phase is LayersPhase.CLIMB
    return climbs or flight.phase is Phase.DESCEND or flight.off_level is not None


def _climb(flight: FlightState, view: TickInput, plan: MissionConfig) -> float:
    """Down velocity, m/s, that keeps the height and the clearance to the ceiling and the fence."""
    descends = flight.phase is Phase.DESCEND
    height_m = LAND_FROM_M if descends else orders.height_m(flight, plan)
    if flight.passing and view.around.lets_pass:
        height_m = flight.passing.height_m(height_m, plan.clearance_m)
    present_m = view.observation.pose.height_m
    down_m_s = climb_to(height_m, present_m)
    down_m_s = orders.down_m_s(flight, view, plan, down_m_s)
    room_m = view.observation.clear_m(Beam.UP) - BODY_RADIUS_M - plan.clearance_m
    room_m = min(room_m, fence.top_m(plan) - present_m)
    least_m_s, most_m_s = view.around.climb_limits_m_s
    least_m_s = max(least_m_s, -approach_speed(room_m, MAX_CLIMB_M_S, CLIMB_LAG_S))
    return max(min(down_m_s, most_m_s), least_m_s)


def _in_time(flight: FlightState, view: TickInput, plan: MissionConfig) -> FlightState:
    """Enters HOME when the remaining time or battery is needed for the path home."""
    spent = Spent(view.time_s - flight.began_s, view.vehicle.battery)
    travels = flight.phase is Phase.BUILDING and flight.building.phase is ExplorePhase.GO
    kept, why = energy_reserve.step(
        flight.reserve, spent, view.observation, view.space, plan, travels=travels
    )
    if kept is not flight.reserve:
        flight = replace(flight, reserve=kept)
    return _turn_back(flight, view, why) if why else flight


def _turn_back(flight: FlightState, view: TickInput, why: str) -> FlightState:
    """Enters HOME. In an extra part this is no trouble: the mission is complete without it.

    In a team it is complete if no teammate looks at something unseen, either.
    """
    parts = flight.room, flight.building, flight.layers
    is_extra = flight.phase in MISSION_PHASES.values() and any(part.is_extra for part in parts)
    is_extra = is_extra and not is_more_expected(view.observation.claims)
    trouble = "" if is_extra else f"turned back {why}"
    homeward = replace(flight, undone=trouble, way_home=Travel(START_NE_M), lost_since_s=math.inf)
    return go(homeward, Phase.HOME, view, trouble)


def _must_hold_place(flight: FlightState, view: TickInput) -> bool:
    """True away from the start while a teammate with the right of way is not heard.

    The teammate keeps off the place at which this drone was when it was heard last.
    """
    return view.observation.waits_for_radio and flight.phase in TASK_PHASES


def _hold_place(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    pose = view.observation.pose
    at_ne_m = flight.holds_at_ne_m or pose.ne_m
    return replace(flight, holds_at_ne_m=at_ne_m), FlightAction(stay(at_ne_m, pose))


def _room(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    room, setpoint = room_scan.step(flight.room, view.observation, view.space, plan)
    if room is not flight.room:
        flight = replace(flight, room=room)
    if room.phase is ScanPhase.CLOSED:
        flight = go(flight, after(Phase.HOME, view), view)
    elif view.around.edge_m < AT_EDGE_M:
        flight = replace(go(flight, Phase.BUILDING, view), notice=BEYOND_FENCE)
    elif room.phase is ScanPhase.BLOCKED:
        flight = go(flight, Phase.BUILDING, view)
    return flight, FlightAction(setpoint)


def _building(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    building, setpoint = explore.step(flight.building, view.observation, view.space, plan)
    flight = replace(flight, building=building)
    if building.phase is ExplorePhase.DONE:
        flight = go(flight, after(Phase.HOME, view), view)
        if plan.kind != "exterior" and (left := in_words(left_unseen(view.space))):
            flight = replace(flight, notice=left)
    return flight, FlightAction(setpoint)


def _layers(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    seen, setpoint = layers.step(flight.layers, view.observation, view.space, plan)
    flight = replace(flight, layers=seen)
    if seen.phase is LayersPhase.DONE:
        flight = go(flight, after(Phase.HOME, view), view)
    return flight, FlightAction(setpoint)


def _hold(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    if view.fault is None:
        return go(flight.rested(), flight.held_from, view, flight.held_trouble), FlightAction(HOLD)
    if age_s(flight, view) > view.fault.lasts_s:
        return land(go(flight, Phase.LAND, view), view, plan)
    return flight, FlightAction(HOLD)


def _taken_away(flight: FlightState, view: TickInput) -> FlightState | None:
    """The ended flight, if the pilot or autopilot has control, or the link is lost for good."""
    vehicle = view.vehicle
    if vehicle.silent_s > LINK_LOST_S:
        return go(flight, Phase.FAILED, view, "no message from the autopilot for 10 s")
    if vehicle.mode_age_s > LINK_LOST_S:
        return go(flight, Phase.FAILED, view, "no HEARTBEAT from the autopilot for 10 s")
    if vehicle.is_silent:
        return None
    if not vehicle.armed:
        return go(flight, Phase.FAILED, view, "the autopilot disarmed in the air")
    if vehicle.left_offboard or not vehicle.in_offboard_mode:
        return hand_over(flight, view)
    return None


def _cut_short(flight: FlightState, view: TickInput, plan: MissionConfig) -> FlightState | None:
    """The flight in HOLD, HOME, DIVERT or LAND, if an order, limit or fault ends the phase."""
    if view.land_requested:
        return go(flight, Phase.LAND, view, "landing was requested")
    if flight.diversion is None and view.time_s - flight.began_s > plan.time_limit_s:
        why = f"time limit of {plan.time_limit_s:.0f} s reached"
        return land_elsewhere(flight, view, plan, why)
    if flight.diversion is None and (why := _must_land_for_the_team(view, plan)):
        return land_elsewhere(flight, view, plan, why)
    if view.fault is not None and flight.phase is not Phase.HOLD:
        held = replace(flight, held_from=flight.phase, held_trouble=flight.trouble)
        return go(held, Phase.HOLD, view, view.fault.text)
    return _with_the_battery(flight, view, plan)


def _must_land_for_the_team(view: TickInput, plan: MissionConfig) -> str:
    """Why a drone lands wherever it is, although it could fly on; empty without a reason."""
    if view.observation.is_contradicted:
        return "its map contradicts that of another drone: is each on its own pad?"
    if view.time_s > view.observation.home_by_s - LANDING_SHARE * plan.reserve_s:
        return "it is not home, and a drone flies on that does not hear it"
    return ""


def _with_the_battery(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> FlightState | None:
    """Enters HOME at the first battery limit, and lands at the second."""
    percent = 100 * (1.0 if view.vehicle.battery is None else view.vehicle.battery)
    if flight.diversion is None and percent <= plan.battery_land_percent:
        return land_elsewhere(flight, view, plan, f"{percent:.0f} % of the battery is left")
    if percent <= plan.battery_home_percent and flight.phase in TASK_PHASES:
        return _turn_back(flight, view, f"with {percent:.0f} % of the battery")
    return None


_STEPS = {
    Phase.CONNECT: connect,
    Phase.PREPARE: prepare,
    Phase.OFFBOARD: offboard,
    Phase.ARM: arm,
    Phase.TAKE_OFF: take_off,
    Phase.ROOM: _room,
    Phase.BUILDING: _building,
    Phase.LAYERS: _layers,
    Phase.HOME: home,
    Phase.DIVERT: divert,
    Phase.DESCEND: descend,
    Phase.FLY_TO: orders.fly_to,
    Phase.FLY_VELOCITY: orders.fly_velocity,
    Phase.HOVER: orders.hover,
    Phase.HOLD: _hold,
    Phase.LAND: land,
}

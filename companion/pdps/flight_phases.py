"""The whole flight, from the first heartbeat to the last.

                                                  ┌─► ROOM ─────┐
    CONNECT ─► PREPARE ─► OFFBOARD ─► ARM ─► TAKE_OFF            ├─► HOME ─► DESCEND ─► LAND ─► DONE
                                                 │└─► BUILDING ─┘    │          │         ▲
                                                 └────────┬──────────┴──────────┘         │
                                                fault     ▼           fault lasts         │
                                                         HOLD ────────────────────────────┘
                                                          │
                                                          │ fault gone: back to where it was
                                                          ▼
    a script orders it step by step: PREPARE waits to be told to take off; TAKE_OFF, the missions
    and HOME end in HOVER, which goes to a mission, HOME or LAND when told to

    the missions, HOME, HOVER:     time or battery is up, no way home   ─► DIVERT, where there is
                                                                           floor nearby, or LAND
    DIVERT:                        over floor that it has flown over    ─► DESCEND
    DESCEND, not over its start:   what is below is no floor            ─► DIVERT, or LAND
                                   no way there, or not in time         ─► LAND
    TAKE_OFF, DESCEND, HOLD:       time or battery is up                ─► LAND
    from every phase in the air:   pilot or autopilot leaves our mode   ─► HANDED_OVER
                                   autopilot disarms                    ─► FAILED
                                   nothing heard for 10 s               ─► FAILED
    before arming:                 the program is to end                ─► FAILED
                                   somebody else arms it, or sends
                                   under our name; battery low          ─► FAILED
    OFFBOARD, ARM:                 somebody changes the mode            ─► HANDED_OVER
    LAND:                          any mode but ours and LAND           ─► HANDED_OVER
    before take-off:               no autopilot, no estimate, arming
                                   refused, each for too long           ─► FAILED

Safety: setpoints go out in TAKE_OFF (PX4), the missions, HOME, DESCEND, HOVER and HOLD, that is
while armed and in the mode that we asked for; before, in OFFBOARD and ARM, they are of zero
velocity and show PX4 that a companion is there. From the moment at which the mode is asked for, a
change of mode that is not the one asked for is the pilot's or the autopilot's: the companion stops
sending at once, asks for nothing more, and does not look whether the mode comes back. That holds
for PX4's LAND after setpoints were late, too: setpoints would bring it back to OFFBOARD. Only what
was armed by our command is flown. Each command goes out right after a HEARTBEAT that has told who
has the drone, so once a second, and not while the link is silent; only for the mode it asks in
between, too. HOLD is a setpoint of zero velocity; if the link is gone, the autopilot comes to rest
by its own setpoint timeout. DONE, HANDED_OVER and FAILED are final.
"""

import enum
import math
from dataclasses import field, replace

from companion.config.settings import MissionConfig
from companion.core.messages import (
    HOLD,
    Beam,
    Command,
    CommandKind,
    Fault,
    LandedState,
    Order,
    Setpoint,
    Task,
    VehicleState,
)
from companion.core.values import value
from companion.mapping.heights import Heights
from companion.mapping.occupancy import Occupancy
from companion.navigation import energy_reserve, travel
from companion.navigation.energy_reserve import Reserve, Spent
from companion.navigation.grid_planner import START_NE_M
from companion.navigation.landing_site import landing_site
from companion.navigation.observation import Observation
from companion.navigation.travel import Travel, TravelPhase
from companion.pdps import explore, layers, room_scan
from companion.pdps.explore import Explore, ExplorePhase
from companion.pdps.layers import Layers, LayersPhase
from companion.pdps.left_unseen import in_words, left_unseen
from companion.pdps.room_scan import RoomScan, ScanPhase
from companion.safety import preflight
from companion.safety.control_laws import (
    CLIMB_LAG_S,
    MAX_CLIMB_M_S,
    approach_speed,
    climb_to,
    stay,
)
from companion.safety.obstacle_memory import Surroundings
from companion.safety.velocity_guard import BODY_RADIUS_M, guarded

HEARTBEAT_S = 1.0
LINK_LOST_S = 10.0
CONNECT_TIMEOUT_S = 8.0
PREPARE_TIMEOUT_S = 60.0
ARM_TIMEOUT_S = 30.0
TAKE_OFF_TIMEOUT_S = 20.0
DISARMED_BY_S = 10.0
"""An autopilot that stands on the ground disarms by itself; by then it is asked to."""
TAKE_OFF_M_S = 0.5
AT_HEIGHT_M = 0.15
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
UP_FOR_S = 2.0
"""ArduCopter 4.1 tells for ever that it is taking off, until it gets a setpoint; a climb of 1.2 m/s
has come to rest by then."""


class Phase(enum.Enum):
    """Where in the diagram above."""

    CONNECT = "waiting for the autopilot"
    PREPARE = "waiting for gyro rest and a usable estimate"
    OFFBOARD = "asking to be followed"
    ARM = "arming"
    TAKE_OFF = "taking off"
    ROOM = "scanning the room"
    BUILDING = "exploring the building"
    LAYERS = "exploring layer by layer"
    HOME = "returning to the start"
    DIVERT = "flying to a place to land"
    DESCEND = "descending"
    HOVER = "waiting for orders"
    HOLD = "holding"
    LAND = "landing"
    DONE = "landed"
    HANDED_OVER = "handed over"
    FAILED = "failed"


MISSION_PHASES = {
    "room": Phase.ROOM,
    "building": Phase.BUILDING,
    "exterior": Phase.BUILDING,
    "layers": Phase.LAYERS,
}
FINAL_PHASES = frozenset({Phase.DONE, Phase.HANDED_OVER, Phase.FAILED})
UNARMED_PHASES = frozenset({Phase.CONNECT, Phase.PREPARE, Phase.OFFBOARD, Phase.ARM})
FLYING_PHASES = frozenset(
    {
        *(Phase.TAKE_OFF, *MISSION_PHASES.values()),
        *(Phase.HOME, Phase.DIVERT, Phase.DESCEND, Phase.HOVER, Phase.HOLD),
    }
)
LEVEL_PHASES = FLYING_PHASES - {Phase.TAKE_OFF, Phase.HOLD}
"""In these the height is kept and every velocity is guarded."""
MAY_DIVERT_PHASES = LEVEL_PHASES - {Phase.DIVERT, Phase.DESCEND}


@value
class TickInput:
    """What the flight knows at one tick."""

    time_s: float
    vehicle: VehicleState
    sight: Observation
    space: Occupancy
    floor: Heights
    gyro_at_rest: bool
    """The gyro's bias has been averaged."""
    fault: Fault | None = None
    """What is not well."""
    around: Surroundings = field(default_factory=Surroundings)
    land_requested: bool = False
    """The user or the operating system asks the program to end."""
    order: Order | None = None
    """A script's; None: the whole mission is flown."""
    starved: str = ""
    """Why the computer has no time to fly; or nothing."""


@value
class FlightState:
    """The flight's whole memory."""

    phase: Phase = Phase.CONNECT
    since_s: float = math.inf
    """Start of the phase; the first starts with the first tick, whatever the clock says then."""
    began_s: float = 0.0
    room: RoomScan = field(default_factory=RoomScan)
    building: Explore = field(default_factory=Explore)
    layers: Layers = field(default_factory=Layers)
    reserve: Reserve = Reserve()
    way_home: Travel = Travel(START_NE_M)
    lost_since_s: float = math.inf
    lost_s: float = -math.inf
    """When it first, and last, found no way home."""
    diversion: Travel | None = None
    """To where it lands, if not at its start,"""
    diverted_s: float = math.inf
    """and since when it has looked for such a place."""
    arrived_s: float = 0.0
    """When it came home."""
    held_from: Phase = Phase.CONNECT
    held_trouble: str = ""
    """Phase and trouble to go back to when the fault is gone."""
    trouble: str = ""
    """Why the drone holds, lands early, was handed over or failed; empty if all went well."""
    notice: str = ""
    """What the pilot is to know; told whenever it changes."""
    mode_before: str = ""
    """The mode out of which ours was asked for."""
    is_others: bool = False
    """Somebody else has armed it: nothing of ours is to touch it."""
    up_since_s: float = math.inf
    """Since when it has been at its height, before it says that it is in the air."""
    land_mode_seen: bool = False
    obeyed: int = 0
    """The number of the last order that was taken up."""

    @property
    def completed(self) -> bool:
        return self.phase is Phase.DONE and not self.trouble

    @property
    def took_off(self) -> bool:
        return self.began_s > 0

    @property
    def ending(self) -> str:
        """How the flight ended, in words."""
        if self.completed:
            return "mission complete"
        return f"{self.phase.value}: {self.trouble}" if self.trouble else self.phase.value

    @property
    def activity(self) -> str:
        """The phase in words, as fine as it is known."""
        parts = {
            Phase.ROOM: self.room.activity,
            Phase.BUILDING: self.building.activity,
            Phase.LAYERS: self.layers.activity,
        }
        return str(parts.get(self.phase, self.phase.value))


@value
class FlightAction:
    """What to ask of the autopilot at this tick."""

    setpoint: Setpoint | None = None
    command: Command | None = None


NOTHING = FlightAction()
ARMED_BY_OTHERS = "it was armed by somebody else; disarm it"
LOOKS_AGAIN = "no way back to the start was found; it looks again"
NO_WAY_HOME = "there is no way back to the start any more"


def step(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """One tick: the next state and what to ask of the autopilot."""
    if flight.phase in FINAL_PHASES:
        return flight, NOTHING
    if math.isinf(flight.since_s):
        flight = replace(flight, since_s=view.time_s)
    if ended := _ended(flight, view, plan):
        return ended, NOTHING
    if flight.phase in FLYING_PHASES and (cut_short := _cut_short(flight, view, plan)):
        flight = cut_short
    if flight.phase in MISSION_PHASES.values():
        flight = _in_time(flight, view, plan)
    flight, action = _STEPS[flight.phase](flight, view, plan)
    if action.setpoint is not None and flight.phase in LEVEL_PHASES:
        level = replace(action.setpoint, down_m_s=_climb(flight, view, plan))
        action = replace(action, setpoint=guarded(level, view.around, plan.clearance_m))
    return flight, action if _may_ask(flight, view.vehicle) else replace(action, command=None)


def _may_ask(flight: FlightState, vehicle: VehicleState) -> bool:
    """While it stands disarmed, between two heartbeats, too."""
    if flight.phase is Phase.OFFBOARD:
        return vehicle.mode_age_s <= HEARTBEAT_S
    return vehicle.is_mode_just_told


def _ended(flight: FlightState, view: TickInput, plan: MissionConfig) -> FlightState | None:
    """By others, or before it has begun."""
    if flight.phase in FLYING_PHASES:
        return _taken_away(flight, view)
    if flight.phase not in UNARMED_PHASES:
        return None
    if view.land_requested and not view.vehicle.armed:
        return _go(flight, Phase.FAILED, view, "it was to end before it took off")
    return None if flight.phase is Phase.CONNECT else _not_to_be_armed(flight, view, plan)


def _climb(flight: FlightState, view: TickInput, plan: MissionConfig) -> float:
    """Down velocity that keeps the height of the layer, and off the ceiling."""
    descends = flight.phase is Phase.DESCEND
    height_m = LAND_FROM_M if descends else flight.layers.height_m(plan)
    down_m_s = climb_to(height_m, view.sight.pose.height_m)
    room_m = view.sight.clear_m(Beam.UP) - BODY_RADIUS_M - plan.clearance_m
    return max(down_m_s, -approach_speed(room_m, MAX_CLIMB_M_S, CLIMB_LAG_S))


def _in_time(flight: FlightState, view: TickInput, plan: MissionConfig) -> FlightState:
    """Home, when what is left of time and battery is needed for the way there."""
    spent = Spent(view.time_s - flight.began_s, view.vehicle.battery)
    kept, why = energy_reserve.step(flight.reserve, spent, view.sight, view.space, plan)
    if kept is not flight.reserve:
        flight = replace(flight, reserve=kept)
    return _turn_back(flight, view, why) if why else flight


def _turn_back(flight: FlightState, view: TickInput, why: str) -> FlightState:
    """What was an extra may end so: the mission is complete without it."""
    parts = flight.room, flight.building, flight.layers
    is_extra = any(part.is_extra for part in parts)
    trouble = "" if is_extra else f"turned back {why}"
    return _go(flight, Phase.HOME, view, trouble)


def _go(
    flight: FlightState, phase: Phase, view: TickInput, trouble: str | None = None
) -> FlightState:
    reason = flight.trouble if trouble is None else trouble
    return replace(flight, phase=phase, since_s=view.time_s, trouble=reason)


def _age_s(flight: FlightState, view: TickInput) -> float:
    return view.time_s - flight.since_s


# Before take-off


def _not_to_be_armed(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> FlightState | None:
    """The drone is in other hands, or is not fit to fly."""
    vehicle = view.vehicle
    if flight.phase is Phase.PREPARE:
        if vehicle.armed:
            trouble = "the vehicle is armed already; disarm it"
            return replace(_go(flight, Phase.FAILED, view, trouble), is_others=True)
        return _go(flight, Phase.FAILED, view, vehicle.unfit) if vehicle.unfit else None
    if _is_mode_changed(flight, vehicle):
        return _hand_over(flight, view)
    if vehicle.armed and (flight.phase is Phase.OFFBOARD or vehicle.is_refused):
        return replace(_go(flight, Phase.FAILED, view, ARMED_BY_OTHERS), is_others=True)
    if not vehicle.armed and (why := preflight.refusal(vehicle, plan)):
        return _go(flight, Phase.FAILED, view, why)
    return None


def _is_mode_changed(flight: FlightState, vehicle: VehicleState) -> bool:
    """By somebody else, since ours was asked for."""
    if vehicle.left_offboard:
        return True
    if vehicle.in_offboard_mode:
        return False
    return flight.phase is Phase.ARM or flight.mode_before not in ("", vehicle.mode)


def _hand_over(flight: FlightState, view: TickInput) -> FlightState:
    """Somebody else has the drone: nothing more is sent.

    It may be the autopilot itself, which lands when setpoints come too late.
    """
    gave_back = view.vehicle.in_offboard_mode
    trouble = "mode changed for a moment" if gave_back else f"mode changed to {view.vehicle.mode}"
    late = f"; {view.starved}" if view.starved else ""
    return _go(flight, Phase.HANDED_OVER, view, trouble + late)


def _connect(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    if view.vehicle.connected:
        told = replace(flight, notice=preflight.MID_STICK)
        return _go(told, Phase.PREPARE, view), NOTHING
    if _age_s(flight, view) > CONNECT_TIMEOUT_S:
        trouble = view.vehicle.unfit or "no autopilot heard"
        return _go(flight, Phase.FAILED, view, trouble), NOTHING
    return flight, NOTHING


def _prepare(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    vehicle = view.vehicle
    if vehicle.estimate_ready and view.gyro_at_rest and not view.starved:
        if view.order is None:
            return _ask_for_mode(flight, view, plan), NOTHING
        if view.order.task is Task.TAKE_OFF:
            asking = replace(flight, obeyed=view.order.number)
            return _ask_for_mode(asking, view, plan), NOTHING
        return replace(flight, since_s=view.time_s), NOTHING
    if _age_s(flight, view) > PREPARE_TIMEOUT_S:
        no_estimate = vehicle.waits_for or "no position estimate"
        missing = "the gyro is not at rest" if vehicle.estimate_ready else no_estimate
        trouble = f"not ready after {PREPARE_TIMEOUT_S:.0f} s: {view.starved or missing}"
        return _go(flight, Phase.FAILED, view, trouble), NOTHING
    return flight, NOTHING


def _ask_for_mode(flight: FlightState, view: TickInput, plan: MissionConfig) -> FlightState:
    """Unless it should not fly."""
    if why := preflight.refusal(view.vehicle, plan):
        return _go(flight, Phase.FAILED, view, why)
    if view.vehicle.battery is None:
        flight = replace(flight, notice=preflight.BATTERY_UNKNOWN)
    return _go(replace(flight, mode_before=view.vehicle.mode), Phase.OFFBOARD, view)


def _offboard(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    if view.vehicle.in_offboard_mode:
        return _arm(_go(flight, Phase.ARM, view), view, plan)
    return _insist(flight, view, Command(CommandKind.OFFBOARD_MODE), ARM_TIMEOUT_S)


def _arm(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    if view.vehicle.armed:
        began = replace(flight, began_s=view.time_s)
        return _go(began, Phase.TAKE_OFF, view), FlightAction(HOLD)
    return _insist(flight, view, Command(CommandKind.ARM), ARM_TIMEOUT_S)


def _take_off(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    vehicle, height_m = view.vehicle, view.sight.pose.height_m
    is_high = height_m > plan.height_m - AT_HEIGHT_M
    up_since_s = min(flight.up_since_s, view.time_s) if is_high else math.inf
    flight = replace(flight, up_since_s=up_since_s)
    stays_up = view.time_s - up_since_s > UP_FOR_S and _is_rising(vehicle)
    if is_high and (vehicle.landed_state is LandedState.IN_AIR or stays_up):
        return _go(flight, _after(MISSION_PHASES[plan.kind], view), view), FlightAction(HOLD)
    if _age_s(flight, view) > TAKE_OFF_TIMEOUT_S:
        return _go(flight, Phase.LAND, view, _not_up(height_m, vehicle, is_high=is_high)), NOTHING
    if vehicle.takes_off_by_setpoint:
        down_m_s = climb_to(plan.height_m, height_m) if is_high else -TAKE_OFF_M_S
        return flight, FlightAction(Setpoint(down_m_s=down_m_s))
    if _is_rising(vehicle) or vehicle.landed_state is LandedState.IN_AIR:
        return flight, NOTHING
    command = Command(CommandKind.TAKE_OFF, plan.height_m)
    return _insist(flight, view, command, TAKE_OFF_TIMEOUT_S)


def _is_rising(vehicle: VehicleState) -> bool:
    return vehicle.landed_state is LandedState.TAKING_OFF


def _not_up(height_m: float, vehicle: VehicleState, *, is_high: bool) -> str:
    """Why the take-off has failed, in words."""
    if is_high:
        told = vehicle.landed_state.name.lower().replace("_", " ")
        return f"at {height_m:.1f} m it still tells {told!r} (EXTENDED_SYS_STATE)"
    reason = f": {vehicle.refusal}" if vehicle.refusal else ""
    return f"still at {max(height_m, 0.0):.1f} m{reason}"


def _insist(
    flight: FlightState, view: TickInput, command: Command, timeout_s: float
) -> tuple[FlightState, FlightAction]:
    """Ask until it is so, or until it has been refused for too long."""
    if _age_s(flight, view) <= timeout_s:
        setpoint = None if command.kind is CommandKind.TAKE_OFF else HOLD
        return flight, FlightAction(setpoint, command)
    refusal = view.vehicle.refusal or "no answer"
    trouble = f"cannot {command.kind.value} after {timeout_s:.0f} s: {refusal}"
    return _go(flight, Phase.FAILED, view, trouble), NOTHING


# In the air


def _room(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    room, setpoint = room_scan.step(flight.room, view.sight, view.space, plan)
    if room is not flight.room:
        flight = replace(flight, room=room)
    if room.phase is ScanPhase.CLOSED:
        flight = _go(flight, _after(Phase.HOME, view), view)
    elif room.phase is ScanPhase.BLOCKED:
        flight = _go(flight, Phase.BUILDING, view)
    return flight, FlightAction(setpoint)


def _building(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    building, setpoint = explore.step(flight.building, view.sight, view.space, plan)
    flight = replace(flight, building=building)
    if building.phase is ExplorePhase.DONE:
        flight = _go(flight, _after(Phase.HOME, view), view)
        if plan.kind != "exterior" and (left := in_words(left_unseen(view.space))):
            flight = replace(flight, notice=left)
    return flight, FlightAction(setpoint)


def _layers(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    seen, setpoint = layers.step(flight.layers, view.sight, view.space, plan)
    flight = replace(flight, layers=seen)
    if seen.phase is LayersPhase.DONE:
        flight = _go(flight, _after(Phase.HOME, view), view)
    return flight, FlightAction(setpoint)


def _home(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    homeward = flight.way_home
    if homeward.phase is TravelPhase.ARRIVED:
        return _settle(flight, view)
    if not homeward.known:
        homeward = replace(homeward, known=flight.building.known_doorways)
    if homeward.phase is TravelPhase.GAVE_UP:
        return _look_for_way_home(flight, view, plan), FlightAction(HOLD)
    going, setpoint = travel.step(homeward, view.sight, view.space, plan)
    flight = replace(flight, way_home=going)
    match going.phase:
        case TravelPhase.ARRIVED:
            return replace(flight, arrived_s=view.time_s), FlightAction(
                stay(START_NE_M, view.sight.pose)
            )
        case TravelPhase.GAVE_UP:
            since_s = min(flight.lost_since_s, view.time_s)
            return replace(flight, lost_since_s=since_s, lost_s=view.time_s), FlightAction(HOLD)
        case _:
            return flight, FlightAction(setpoint)


def _look_for_way_home(flight: FlightState, view: TickInput, plan: MissionConfig) -> FlightState:
    """Anew, as if none of the ways had been tried; in the end it lands elsewhere."""
    if view.time_s - flight.lost_since_s > LOOKS_FOR_WAY_HOME_S:
        return _land_elsewhere(flight, view, plan, NO_WAY_HOME)
    if view.time_s - flight.lost_s < LOOKS_AGAIN_S:
        return flight
    return replace(flight, way_home=Travel(START_NE_M), notice=LOOKS_AGAIN)


def _land_elsewhere(
    flight: FlightState, view: TickInput, plan: MissionConfig, why: str
) -> FlightState:
    """On floor that it has flown over nearby, if there is any and it has room to fly there."""
    if flight.phase not in MAY_DIVERT_PHASES:
        return _go(flight, Phase.LAND, view, why)
    return _divert_to_floor(_go(flight, flight.phase, view, why), view, plan)


def _divert_to_floor(flight: FlightState, view: TickInput, plan: MissionConfig) -> FlightState:
    here = view.sight.pose.ne_m
    site = landing_site(here, view.space, view.floor, plan)
    if site == here:
        return _go(flight, Phase.LAND, view)
    since_s = min(flight.diverted_s, view.time_s)
    return _go(replace(flight, diversion=Travel(site), diverted_s=since_s), Phase.DIVERT, view)


def _divert(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    assert flight.diversion is not None
    going, setpoint = travel.step(flight.diversion, view.sight, view.space, plan)
    flight = replace(flight, diversion=going)
    if going.phase is TravelPhase.ARRIVED:
        return _go(flight, Phase.DESCEND, view), FlightAction(HOLD)
    if going.phase is TravelPhase.GAVE_UP or view.time_s - flight.diverted_s > DIVERTS_S:
        return _go(flight, Phase.LAND, view), FlightAction(HOLD)
    return flight, FlightAction(setpoint)


def _settle(flight: FlightState, view: TickInput) -> tuple[FlightState, FlightAction]:
    """Come to rest over the start: an autopilot that is told to land goes on by half a metre."""
    pose = view.sight.pose
    is_over = math.dist(pose.ne_m, START_NE_M) < OVER_START_M
    waited_s = view.time_s - flight.arrived_s
    if waited_s > SETTLES_S or (is_over and waited_s > 0.5 * SETTLES_S):
        flight = _go(flight, _after(Phase.DESCEND, view), view)
    return flight, FlightAction(stay(START_NE_M, view.sight.pose))


def _descend(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    if flight.diversion is not None and _is_table_below(view):
        return _divert_to_floor(flight, view, plan), FlightAction(HOLD)
    is_low = view.sight.pose.height_m < LAND_FROM_M + AT_HEIGHT_M
    if is_low or _age_s(flight, view) > DESCENT_TIMEOUT_S:
        return _go(flight, Phase.LAND, view), FlightAction(HOLD)
    over_ne_m = flight.diversion.goal_ne_m if flight.diversion else START_NE_M
    return flight, FlightAction(stay(over_ne_m, view.sight.pose))


def _is_table_below(view: TickInput) -> bool:
    """What the down beam meets is not floor; the floor nearer than half a metre is not told."""
    height_m, reading = view.sight.pose.height_m, view.sight.ranges.get(Beam.DOWN)
    if reading is None or not reading.is_distance or height_m < TELLS_FLOOR_FROM_M:
        return False
    return abs(height_m - view.sight.mount_offset_m - reading.distance_m) > FLOOR_OFF_M


def _after(planned: Phase, view: TickInput) -> Phase:
    """What follows: as planned, or whatever a script will order."""
    return planned if view.order is None else Phase.HOVER


def _hover(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    order = view.order
    if order is None or order.number <= flight.obeyed:
        return flight, FlightAction(HOLD)
    match order.task:
        case Task.SCAN:
            fresh = replace(flight, room=RoomScan(), building=Explore(), layers=Layers())
            return _obey(fresh, MISSION_PHASES[plan.kind], view, order), FlightAction(HOLD)
        case Task.HOME:
            homeward = replace(flight, way_home=Travel(START_NE_M), lost_since_s=math.inf)
            return _obey(homeward, Phase.HOME, view, order), FlightAction(HOLD)
        case Task.LAND:
            return _obey(flight, Phase.LAND, view, order), FlightAction(HOLD)
        case _:
            return replace(flight, obeyed=order.number), FlightAction(HOLD)


def _obey(flight: FlightState, phase: Phase, view: TickInput, order: Order) -> FlightState:
    return replace(_go(flight, phase, view), obeyed=order.number)


def _hold(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    if view.fault is None:
        return _go(flight, flight.held_from, view, flight.held_trouble), FlightAction(HOLD)
    if _age_s(flight, view) > view.fault.lasts_s:
        return _land(_go(flight, Phase.LAND, view), view, plan)
    return flight, FlightAction(HOLD)


def _land(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    vehicle = view.vehicle
    if max(vehicle.silent_s, vehicle.mode_age_s) > LINK_LOST_S:
        trouble = f"{flight.trouble or 'link lost while landing'}; nothing heard for 10 s"
        return _go(flight, Phase.FAILED, view, trouble), NOTHING
    if vehicle.is_silent or not vehicle.is_mode_just_told:
        return flight, NOTHING  # somebody else may have it by now
    if not vehicle.armed:
        return _go(flight, Phase.DONE, view), NOTHING
    if vehicle.mode == "LAND":
        stands = vehicle.landed_state is LandedState.ON_GROUND
        disarm = stands and _age_s(flight, view) > DISARMED_BY_S
        command = Command(CommandKind.DISARM) if disarm else None
        return replace(flight, land_mode_seen=True), FlightAction(command=command)
    gave_back = vehicle.in_offboard_mode and vehicle.left_offboard
    if flight.land_mode_seen or gave_back or not vehicle.in_offboard_mode:
        return _hand_over(flight, view), NOTHING
    return flight, FlightAction(command=Command(CommandKind.LAND))


def _taken_away(flight: FlightState, view: TickInput) -> FlightState | None:
    """The flight is no longer ours: pilot, autopilot, or a link that is gone for good."""
    vehicle = view.vehicle
    if vehicle.silent_s > LINK_LOST_S:
        return _go(flight, Phase.FAILED, view, "nothing heard from the autopilot for 10 s")
    if vehicle.mode_age_s > LINK_LOST_S:
        return _go(flight, Phase.FAILED, view, "no HEARTBEAT from the autopilot for 10 s")
    if vehicle.is_silent:
        return None
    if not vehicle.armed:
        return _go(flight, Phase.FAILED, view, "the autopilot disarmed in the air")
    if vehicle.left_offboard or not vehicle.in_offboard_mode:
        return _hand_over(flight, view)
    return None


def _cut_short(flight: FlightState, view: TickInput, plan: MissionConfig) -> FlightState | None:
    """The flight goes on, but not as planned."""
    if view.land_requested:
        return _go(flight, Phase.LAND, view, "landing was requested")
    if flight.diversion is None and view.time_s - flight.began_s > plan.time_limit_s:
        why = f"time limit of {plan.time_limit_s:.0f} s reached"
        return _land_elsewhere(flight, view, plan, why)
    if view.fault is not None and flight.phase is not Phase.HOLD:
        held = replace(flight, held_from=flight.phase, held_trouble=flight.trouble)
        return _go(held, Phase.HOLD, view, view.fault.text)
    return _with_the_battery(flight, view, plan)


def _with_the_battery(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> FlightState | None:
    """Home while there is enough for the way, down before it is empty."""
    percent = 100 * (1.0 if view.vehicle.battery is None else view.vehicle.battery)
    if flight.diversion is None and percent <= plan.battery_land_percent:
        return _land_elsewhere(flight, view, plan, f"{percent:.0f} % of the battery is left")
    if percent <= plan.battery_home_percent and flight.phase in MISSION_PHASES.values():
        return _turn_back(flight, view, f"with {percent:.0f} % of the battery")
    return None


_STEPS = {
    Phase.CONNECT: _connect,
    Phase.PREPARE: _prepare,
    Phase.OFFBOARD: _offboard,
    Phase.ARM: _arm,
    Phase.TAKE_OFF: _take_off,
    Phase.ROOM: _room,
    Phase.BUILDING: _building,
    Phase.LAYERS: _layers,
    Phase.HOME: _home,
    Phase.DIVERT: _divert,
    Phase.DESCEND: _descend,
    Phase.HOVER: _hover,
    Phase.HOLD: _hold,
    Phase.LAND: _land,
}

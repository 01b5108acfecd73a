"""Steps of the phases that execute the orders of a script, and the heights that they lead to.

    HOVER ──a new order──► a mission, FLY_TO, FLY_VELOCITY, HOME, LAND
    a mission, FLY_TO, FLY_VELOCITY, HOME ──completed, refused, or a new order──► HOVER

A new order replaces the one before. The return with the battery that is left is not replaced.

Safety: the map holds at its own height. From another height the drone returns to that of the map
before it travels. At a velocity it flies there as slowly as into space that no beam has swept.
"""

import math
from dataclasses import replace

from companion.config.settings import MissionConfig
from companion.core.messages import HOLD, Beam, Setpoint
from companion.navigation.grid_planner import START_NE_M
from companion.navigation.travel_state import Travel
from companion.pdps.explore import Explore
from companion.pdps.flight import fly_to as flying
from companion.pdps.flight.fly_to import FlyTo, FlyToPhase
from companion.pdps.flight.fly_velocity import MIN_HEIGHT_M, FlyVelocity
from companion.pdps.flight.order import Order, Task
from companion.pdps.flight.state import (
    LEVEL_PHASES,
    MISSION_PHASES,
    TASK_PHASES,
    FlightAction,
    FlightState,
    OffLevel,
    Phase,
    PhaseStep,
    TickInput,
    go,
)
from companion.pdps.layers import Layers
from companion.pdps.room_scan_state import RoomScan
from companion.safety.control_laws import (
    BODY_RADIUS_M,
    CLIMB_LAG_S,
    MAX_CLIMB_M_S,
    approach_speed,
    clamp,
    stay,
)

LEVEL_M = 0.08
"""Maximum distance from the height of the map at which it holds, m: that of a layer."""
LEVELS_S = 30.0
"""Timeout of the return to the height of the map, s: more than a change by 9 m takes."""
REPLACED = "another step or stop() ended it"
"""Reason why an order was not completed."""
HOLDS_HEIGHT_PHASES = frozenset({Phase.HOVER, Phase.FLY_VELOCITY})
"""Phases that hold the height to which an order has led."""
TRAVEL_PHASES = LEVEL_PHASES - HOLDS_HEIGHT_PHASES - {Phase.DESCEND}
"""Phases that return to the height of the map first."""


def hover(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """HOVER: holds, and begins a new order."""
    order = view.order
    if order is not None and order.number > flight.obeyed:
        flight = _begin(flight, view, plan, order)
    return flight, FlightAction(HOLD)


def _begin(flight: FlightState, view: TickInput, plan: MissionConfig, order: Order) -> FlightState:
    phase = Phase.HOVER
    match order.task:
        case Task.SCAN:
            phase = MISSION_PHASES[plan.kind]
            flight = replace(flight, room=RoomScan(), building=Explore(), layers=Layers())
        case Task.FLY_TO if order.target is not None:
            phase = Phase.FLY_TO
            flight = replace(flight, fly_to=FlyTo.begin(order.target, order.until_s))
        case Task.FLY_VELOCITY if not _is_over(flight, view, order):
            phase = Phase.FLY_VELOCITY
            flight = replace(flight, fly_velocity=FlyVelocity(order.velocity, order.until_s))
        case Task.HOME:
            phase = Phase.HOME
            flight = replace(flight, way_home=Travel(START_NE_M), lost_since_s=math.inf)
        case Task.LAND:
            phase = Phase.LAND
    if phase is not Phase.HOVER:
        flight = go(flight, phase, view)
    undone = flight.undone if order.renews else ""
    return replace(flight, obeyed=order.number, undone=undone)


def _is_over(flight: FlightState, view: TickInput, order: Order) -> bool:
    return view.time_s >= order.until_s or (order.renews and bool(flight.undone))


def comes_first(flight: FlightState, view: TickInput) -> PhaseStep | None:
    """The step that comes before that of the phase; None without one."""
    if _is_replaced(flight, view):
        return _stop
    return _to_level if flight.phase in TRAVEL_PHASES and _is_to_level(flight) else None


def _is_replaced(flight: FlightState, view: TickInput) -> bool:
    """True if a new order ends the step that the drone executes."""
    if view.order is None or view.order.number <= flight.obeyed:
        return False
    if flight.phase is Phase.FLY_VELOCITY and view.order.task is Task.FLY_VELOCITY:
        return False
    is_replaceable = flight.phase in TASK_PHASES or flight.phase is Phase.HOME
    return is_replaceable and not flight.undone


def _stop(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """Stops where the drone is, also while it changes its height."""
    if flight.off_level is not None:
        height_m = view.observation.pose.height_m
        flight = replace(flight, off_level=_off_level(height_m, flight.layers.height_m(plan)))
    return _to_hover(flight, view, REPLACED), FlightAction(HOLD)


def _to_hover(flight: FlightState, view: TickInput, undone: str = "") -> FlightState:
    return replace(go(flight, Phase.HOVER, view), undone=undone)


def fly_to(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """FLY_TO: flies to a place, and turns and climbs there."""
    assert flight.fly_to is not None
    level_m = flight.layers.height_m(plan)
    going, setpoint = flying.step(flight.fly_to, view.observation, view.space, plan, level_m)
    flight = replace(flight, fly_to=going)
    if going.phase is FlyToPhase.PLACE and going.target.height_m is not None:
        flight = replace(flight, off_level=_off_level(going.target.height_m, level_m))
    if going.phase in (FlyToPhase.DONE, FlyToPhase.REFUSED):
        if going.refusal and flight.off_level is not None:
            off_level = _off_level(view.observation.pose.height_m, level_m)
            flight = replace(flight, off_level=off_level)
        flight = _to_hover(flight, view, going.refusal)
    return flight, FlightAction(setpoint)


def fly_velocity(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """FLY_VELOCITY: flies at a velocity until its time is over; a new order renews it."""
    moving, order = flight.fly_velocity, view.order
    assert moving is not None
    if order is not None and order.number > flight.obeyed:
        moving = moving.renewed(order)
        flight = replace(flight, fly_velocity=moving, obeyed=order.number)
    if view.time_s >= moving.until_s:
        return _to_hover(flight, view), FlightAction(HOLD)
    level_m, pose = flight.layers.height_m(plan), view.observation.pose
    if moving.wanted.down_m_s:
        # the drone moves on during the lag, and is to hover where that ends
        height_m = pose.height_m - CLIMB_LAG_S * moving.wanted.down_m_s
        flight = replace(flight, off_level=_off_level(height_m, level_m))
    setpoint = moving.setpoint(is_off_level=flight.off_level is not None)
    return flight, FlightAction(setpoint)


def note_limits(flight: FlightState, view: TickInput, allowed: Setpoint) -> FlightState:
    """The state after the limits at this tick: HOVER if they refuse the ordered velocity."""
    if flight.phase is not Phase.FLY_VELOCITY or flight.fly_velocity is None or flight.passing:
        return flight
    moving = flight.fly_velocity.see(allowed, view.time_s)
    flight = replace(flight, fly_velocity=moving)
    refusal = moving.refusal(view.around, view.time_s)
    return _to_hover(flight, view, refusal) if refusal else flight


# Heights


def _off_level(height_m: float, level_m: float) -> OffLevel | None:
    return OffLevel(height_m) if abs(height_m - level_m) > LEVEL_M else None


def _is_to_level(flight: FlightState) -> bool:
    """True if the drone is off the height of the map, and not at its target."""
    is_at_target = (
        flight.phase is Phase.FLY_TO
        and flight.fly_to is not None
        and flight.fly_to.phase is FlyToPhase.PLACE
    )
    return flight.off_level is not None and not is_at_target


def _to_level(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """Returns to the height of the map where the drone is; gives up after `LEVELS_S`."""
    pose, off_level, level_m = view.observation.pose, flight.off_level, flight.layers.height_m(plan)
    assert off_level is not None
    if abs(pose.height_m - level_m) < LEVEL_M:
        return replace(flight.rested(), off_level=None), FlightAction(HOLD)
    if off_level.from_ne_m is None:
        off_level = replace(off_level, from_ne_m=pose.ne_m, since_s=view.time_s)
        flight = replace(flight, off_level=off_level)
    if view.time_s - off_level.since_s <= LEVELS_S:
        return flight, FlightAction(stay(off_level.from_ne_m or pose.ne_m, pose))
    why = f"the way back to the height of the map, {level_m:.1f} m, is not free"
    if flight.phase in TASK_PHASES:
        stopped = replace(flight, off_level=_off_level(pose.height_m, level_m))
        return _to_hover(stopped, view, why), FlightAction(HOLD)
    return go(flight, Phase.LAND, view, why), FlightAction(HOLD)


def height_m(flight: FlightState, plan: MissionConfig) -> float:
    """Height that the drone holds or returns to, above the take-off point, m."""
    level_m = flight.layers.height_m(plan)
    if flight.off_level is None or flight.off_level.from_ne_m is not None:
        return level_m
    holds = flight.phase in HOLDS_HEIGHT_PHASES or flight.phase is Phase.FLY_TO
    return flight.off_level.height_m if holds else level_m


def down_m_s(
    flight: FlightState, view: TickInput, plan: MissionConfig, to_height_m_s: float
) -> float:
    """Down velocity, m/s: by order, or the one to the height; with clearance to what is below."""
    wanted_m_s = to_height_m_s
    if flight.phase is Phase.FLY_VELOCITY and flight.fly_velocity and not flight.passing:
        by_order_m_s = flight.fly_velocity.wanted.down_m_s
        wanted_m_s = clamp(by_order_m_s, MAX_CLIMB_M_S) if by_order_m_s else to_height_m_s
    is_under_map = height_m(flight, plan) < flight.layers.height_m(plan)
    if wanted_m_s <= 0 or not is_under_map or flight.phase is Phase.DESCEND:
        return wanted_m_s
    over_m = view.observation.clear_m(Beam.DOWN) - BODY_RADIUS_M - plan.clearance_m
    over_m = min(over_m, view.observation.pose.height_m - MIN_HEIGHT_M)
    return min(wanted_m_s, approach_speed(over_m, MAX_CLIMB_M_S, CLIMB_LAG_S))

"""Steps of the phases before a mission, from the first HEARTBEAT to the mission height."""

import math
from dataclasses import replace

from companion.config.settings import MissionConfig
from companion.core.messages import HOLD, Command, CommandKind, LandedState, Setpoint, VehicleState
from companion.pdps.flight.order import Task
from companion.pdps.flight.state import (
    MISSION_PHASES,
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
from companion.safety import preflight
from companion.safety.control_laws import climb_to

CONNECT_TIMEOUT_S = 8.0
"""Timeout for the first message of the autopilot, s. Chosen."""
PREPARE_TIMEOUT_S = 60.0
"""Timeout for the position estimate and the gyro's rest, s. Chosen."""
ARM_TIMEOUT_S = 30.0
"""Timeout for the change of mode, and for arming, s. Chosen."""
TAKE_OFF_TIMEOUT_S = 20.0
"""Timeout for the take-off, s. Chosen."""
TAKE_OFF_M_S = 0.5
"""Climb rate of a take-off by setpoints, m/s. Chosen."""
AT_HEIGHT_M = 0.15
"""Maximum height error at which a height counts as reached, m. Chosen."""
UP_FOR_S = 2.0
"""Time at the mission height after which a take-off counts as finished, s. ArduCopter 4.1 reports
TAKING_OFF until it receives a setpoint. After this time a climb at 1.2 m/s has come to rest."""
ARMED_BY_OTHERS = "the vehicle is armed already; disarm it"
"""Trouble if another party armed the vehicle."""


def not_to_be_armed(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> FlightState | None:
    """The ended flight, if another party has control or the vehicle is not fit to fly."""
    vehicle = view.vehicle
    if flight.phase is Phase.PREPARE:
        if vehicle.armed:
            trouble = "the vehicle is armed already; disarm it"
            return replace(go(flight, Phase.FAILED, view, trouble), is_others=True)
        return go(flight, Phase.FAILED, view, vehicle.unfit) if vehicle.unfit else None
    if _is_mode_changed(flight, vehicle):
        return hand_over(flight, view)
    if vehicle.armed and (flight.phase is Phase.OFFBOARD or vehicle.is_refused):
        return replace(go(flight, Phase.FAILED, view, ARMED_BY_OTHERS), is_others=True)
    if not vehicle.armed and (why := preflight.refusal(vehicle, plan)):
        return go(flight, Phase.FAILED, view, why)
    return None


def _is_mode_changed(flight: FlightState, vehicle: VehicleState) -> bool:
    """True if another party changed the mode since the companion requested its own."""
    if vehicle.left_offboard:
        return True
    if vehicle.in_offboard_mode:
        return False
    return flight.phase is Phase.ARM or flight.mode_before not in ("", vehicle.mode)


def connect(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """CONNECT: waits for the autopilot."""
    if view.vehicle.connected:
        informed = replace(flight, notice=preflight.MID_STICK)
        return go(informed, Phase.PREPARE, view), NOTHING
    if age_s(flight, view) > CONNECT_TIMEOUT_S:
        trouble = view.vehicle.unfit or "no HEARTBEAT from an autopilot"
        return go(flight, Phase.FAILED, view, trouble), NOTHING
    return flight, NOTHING


def prepare(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """PREPARE: waits for the estimate, the sensors, teammates and, with a script, the order."""
    vehicle, is_free = view.vehicle, view.around.is_column_free
    is_sound = view.gyro_at_rest and view.fault is None and not view.starved
    if vehicle.estimate_ready and is_sound and is_free:
        if view.order is None:
            return _ask_for_mode(flight, view, plan), NOTHING
        if view.order.task is Task.TAKE_OFF:
            asking = replace(flight, obeyed=view.order.number)
            return _ask_for_mode(asking, view, plan), NOTHING
        return replace(flight, since_s=view.time_s), NOTHING
    if age_s(flight, view) > PREPARE_TIMEOUT_S:
        no_estimate = vehicle.waits_for or "no position estimate"
        missing = "the gyro is not at rest" if is_free else "a teammate flies above the pad"
        missing = view.fault.text if view.fault is not None else missing
        missing = missing if vehicle.estimate_ready else no_estimate
        trouble = f"not ready after {PREPARE_TIMEOUT_S:.0f} s: {view.starved or missing}"
        return go(flight, Phase.FAILED, view, trouble), NOTHING
    return flight, NOTHING


def _ask_for_mode(flight: FlightState, view: TickInput, plan: MissionConfig) -> FlightState:
    """Enters OFFBOARD, or FAILED if the preflight checks refuse the flight."""
    if why := preflight.refusal(view.vehicle, plan):
        return go(flight, Phase.FAILED, view, why)
    if view.vehicle.battery is None:
        flight = replace(flight, notice=preflight.BATTERY_UNKNOWN)
    return go(replace(flight, mode_before=view.vehicle.mode), Phase.OFFBOARD, view)


def offboard(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """OFFBOARD: requests the companion's mode."""
    if view.vehicle.in_offboard_mode:
        return arm(go(flight, Phase.ARM, view), view, plan)
    return _insist(flight, view, Command(CommandKind.OFFBOARD_MODE), ARM_TIMEOUT_S)


def arm(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """ARM: requests arming, while there is no fault."""
    if view.vehicle.armed:
        began = replace(flight, began_s=view.time_s)
        return go(began, Phase.TAKE_OFF, view), FlightAction(HOLD)
    asked, action = _insist(flight, view, Command(CommandKind.ARM), ARM_TIMEOUT_S)
    if view.fault is None:
        return asked, action
    if asked.phase is Phase.FAILED:
        return replace(asked, trouble=f"not armed: {view.fault.text}"), NOTHING
    return asked, replace(action, command=None)


def take_off(
    flight: FlightState, view: TickInput, plan: MissionConfig
) -> tuple[FlightState, FlightAction]:
    """TAKE_OFF: climbs by command or, with PX4, by setpoints."""
    vehicle, height_m = view.vehicle, view.observation.pose.height_m
    is_high = height_m > plan.height_m - AT_HEIGHT_M
    up_since_s = min(flight.up_since_s, view.time_s) if is_high else math.inf
    flight = replace(flight, up_since_s=up_since_s)
    stays_up = view.time_s - up_since_s > UP_FOR_S and _is_rising(vehicle)
    if is_high and (vehicle.landed_state is LandedState.IN_AIR or stays_up):
        return go(flight, after(MISSION_PHASES[plan.kind], view), view), FlightAction(HOLD)
    if age_s(flight, view) > TAKE_OFF_TIMEOUT_S:
        return go(flight, Phase.LAND, view, _not_up(height_m, vehicle, is_high=is_high)), NOTHING
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
    """Reason why the take-off has failed."""
    if is_high:
        reported = vehicle.landed_state.name.lower().replace("_", " ")
        return f"at {height_m:.1f} m the autopilot still reports {reported!r} (EXTENDED_SYS_STATE)"
    reason = f": {vehicle.refusal}" if vehicle.refusal else ""
    return f"still at {max(height_m, 0.0):.1f} m{reason}"


def _insist(
    flight: FlightState, view: TickInput, command: Command, timeout_s: float
) -> tuple[FlightState, FlightAction]:
    """Repeats a command. Enters FAILED after the timeout."""
    if age_s(flight, view) <= timeout_s:
        setpoint = None if command.kind is CommandKind.TAKE_OFF else HOLD
        return flight, FlightAction(setpoint, command)
    refusal = view.vehicle.refusal or "no answer"
    trouble = f"cannot {command.kind.value} after {timeout_s:.0f} s: {refusal}"
    return go(flight, Phase.FAILED, view, trouble), NOTHING

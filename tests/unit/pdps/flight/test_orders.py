"""Tests a flight by a script's orders: every transition to and from HOVER."""

from dataclasses import replace

import pytest

from companion.core.messages import HOLD, CommandKind
from companion.pdps.explore import Explore, ExplorePhase
from companion.pdps.flight.order import Order, Task
from companion.pdps.flight.phases import step
from companion.pdps.flight.state import FlightState, Phase, TickInput
from companion.pdps.room_scan_state import RoomScan, ScanPhase
from tests.unit.pdps.flight.flight_ticks import FLYING, ON_GROUND, PLAN, SILENT, asks, flying, view

WAIT = Order()
TAKE_OFF, SCAN, HOME, LAND = (
    Order(number, task)
    for number, task in enumerate((Task.TAKE_OFF, Task.SCAN, Task.HOME, Task.LAND), start=1)
)


def ordered(order: Order, seen: TickInput | None = None) -> TickInput:
    return replace(seen or view(), order=order)


def after(flight: FlightState, seen: TickInput) -> FlightState:
    return step(flight, seen, PLAN)[0]


def test_the_drone_waits_on_the_ground_for_an_order_without_a_timeout() -> None:
    flight = flying(Phase.PREPARE)
    for time_s in (100.0, 200.0, 1000.0):
        flight = after(flight, ordered(WAIT, view(ON_GROUND, time_s=time_s)))
        assert flight.phase is Phase.PREPARE
    taken = after(flight, ordered(TAKE_OFF, view(ON_GROUND, time_s=1001.0)))
    assert (taken.phase, taken.obeyed) == (Phase.OFFBOARD, TAKE_OFF.number)


def test_the_drone_hovers_after_take_off() -> None:
    assert after(flying(Phase.TAKE_OFF), ordered(TAKE_OFF)).phase is Phase.HOVER


def test_hover_commands_zero_velocity_until_a_new_order() -> None:
    hovering = replace(flying(Phase.HOVER), obeyed=TAKE_OFF.number)
    flight, action = step(hovering, ordered(TAKE_OFF), PLAN)
    assert flight.phase is Phase.HOVER
    assert action.setpoint == HOLD


@pytest.mark.parametrize(
    ("order", "phase"), [(SCAN, Phase.ROOM), (HOME, Phase.HOME), (LAND, Phase.LAND)]
)
def test_a_new_order_is_executed(order: Order, phase: Phase) -> None:
    hovering = replace(flying(Phase.HOVER), obeyed=order.number - 1)
    flight = after(hovering, ordered(order))
    assert (flight.phase, flight.obeyed) == (phase, order.number)


def test_a_second_scan_starts_from_its_initial_state() -> None:
    done = replace(flying(Phase.HOVER), room=RoomScan(ScanPhase.CLOSED), obeyed=1)
    assert after(done, ordered(SCAN)).room == RoomScan()


def test_the_drone_hovers_after_a_completed_order() -> None:
    scanning = replace(flying(Phase.ROOM), obeyed=SCAN.number)
    closed = replace(scanning, room=RoomScan(ScanPhase.CLOSED))
    seen = replace(scanning, phase=Phase.BUILDING, building=Explore(ExplorePhase.DONE))
    at_home = view(position=(0.0, 0.0))
    for flight in (closed, seen):
        done = after(flight, ordered(SCAN))
        assert (done.phase, done.undone) == (Phase.HOVER, "")
    homeward = replace(flying(Phase.HOME), obeyed=HOME.number)
    assert after(homeward, ordered(HOME, at_home)).phase in (Phase.HOME, Phase.HOVER)


def test_the_drone_lands_in_any_phase_when_the_script_ends() -> None:
    for phase in (Phase.TAKE_OFF, Phase.ROOM, Phase.HOME, Phase.HOVER):
        flight = after(flying(phase), ordered(SCAN, view(land_requested=True)))
        assert (flight.phase, flight.trouble) == (Phase.LAND, "landing was requested")


def test_a_landing_request_before_arming_ends_the_flight() -> None:
    for phase in (Phase.CONNECT, Phase.PREPARE, Phase.OFFBOARD):
        flight, action = step(flying(phase), view(ON_GROUND, land_requested=True), PLAN)
        assert flight.phase is Phase.FAILED
        assert asks(action) is None


def test_faults_pilot_and_time_limit_apply_while_hovering() -> None:
    hovering = flying(Phase.HOVER)
    pilot = replace(FLYING, mode="LOITER", in_offboard_mode=False)
    assert after(hovering, ordered(WAIT, view(pilot))).phase is Phase.HANDED_OVER
    assert after(hovering, ordered(WAIT, view(fault=SILENT))).phase is Phase.HOLD
    late = view(time_s=91.0 + PLAN.time_limit_s)
    assert after(hovering, ordered(WAIT, late)).phase is Phase.LAND


def test_an_ordered_landing_completes_the_flight() -> None:
    landing = after(replace(flying(Phase.HOVER), obeyed=3), ordered(LAND))
    flight, action = step(landing, ordered(LAND), PLAN)
    assert asks(action) is CommandKind.LAND
    assert after(flight, ordered(LAND, view(ON_GROUND))).completed

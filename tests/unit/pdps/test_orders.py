"""Tests a flight by a script's orders: every transition to and from HOVER."""

from dataclasses import replace

import pytest

from companion.core.messages import HOLD, CommandKind, Order, Task
from companion.pdps.explore import Explore, ExplorePhase
from companion.pdps.flight.phases import step
from companion.pdps.flight.state import FlightState, Phase, TickInput
from companion.pdps.room_scan_state import RoomScan, ScanPhase
from tests.unit.pdps.test_flight_phases import FLYING, ON_GROUND, PLAN, SILENT, asks, flying, view

WAIT = Order()
TAKE_OFF, SCAN, HOME, LAND = (
    Order(number, task)
    for number, task in enumerate((Task.TAKE_OFF, Task.SCAN, Task.HOME, Task.LAND), start=1)
)


def ordered(order: Order, seen: TickInput | None = None) -> TickInput:
    return replace(seen or view(), order=order)


def after(flight: FlightState, seen: TickInput) -> FlightState:
    return step(flight, seen, PLAN)[0]


def test_on_the_ground_it_waits_for_an_order_for_as_long_as_it_takes() -> None:
    flight = flying(Phase.PREPARE)
    for time_s in (100.0, 200.0, 1000.0):
        flight = after(flight, ordered(WAIT, view(ON_GROUND, time_s=time_s)))
        assert flight.phase is Phase.PREPARE
    taken = after(flight, ordered(TAKE_OFF, view(ON_GROUND, time_s=1001.0)))
    assert (taken.phase, taken.obeyed) == (Phase.OFFBOARD, TAKE_OFF.number)


def test_at_height_it_hovers() -> None:
    assert after(flying(Phase.TAKE_OFF), ordered(TAKE_OFF)).phase is Phase.HOVER


def test_while_it_hovers_it_stands_still_until_a_new_order() -> None:
    hovering = replace(flying(Phase.HOVER), obeyed=TAKE_OFF.number)
    flight, action = step(hovering, ordered(TAKE_OFF), PLAN)
    assert flight.phase is Phase.HOVER
    assert action.setpoint == HOLD


@pytest.mark.parametrize(
    ("order", "phase"), [(SCAN, Phase.ROOM), (HOME, Phase.HOME), (LAND, Phase.LAND)]
)
def test_a_new_order_is_taken_up(order: Order, phase: Phase) -> None:
    hovering = replace(flying(Phase.HOVER), obeyed=order.number - 1)
    flight = after(hovering, ordered(order))
    assert (flight.phase, flight.obeyed) == (phase, order.number)


def test_a_second_scan_begins_anew() -> None:
    done = replace(flying(Phase.HOVER), room=RoomScan(ScanPhase.CLOSED), obeyed=1)
    assert after(done, ordered(SCAN)).room == RoomScan()


def test_what_is_done_ends_in_hovering() -> None:
    closed = replace(flying(Phase.ROOM), room=RoomScan(ScanPhase.CLOSED))
    seen = replace(flying(Phase.BUILDING), building=Explore(ExplorePhase.DONE))
    at_home = view(position=(0.0, 0.0))
    assert after(closed, ordered(SCAN)).phase is Phase.HOVER
    assert after(seen, ordered(SCAN)).phase is Phase.HOVER
    assert after(flying(Phase.HOME), ordered(HOME, at_home)).phase in (Phase.HOME, Phase.HOVER)


def test_it_lands_when_the_script_ends_whatever_it_does() -> None:
    for phase in (Phase.TAKE_OFF, Phase.ROOM, Phase.HOME, Phase.HOVER):
        flight = after(flying(phase), ordered(SCAN, view(land_requested=True)))
        assert (flight.phase, flight.trouble) == (Phase.LAND, "landing was requested")


def test_before_arming_it_ends_at_once_when_asked_to() -> None:
    for phase in (Phase.CONNECT, Phase.PREPARE, Phase.OFFBOARD):
        flight, action = step(flying(phase), view(ON_GROUND, land_requested=True), PLAN)
        assert flight.phase is Phase.FAILED
        assert asks(action) is None


def test_hovering_is_no_refuge_from_faults_pilot_or_time() -> None:
    hovering = flying(Phase.HOVER)
    pilot = replace(FLYING, mode="LOITER", in_offboard_mode=False)
    assert after(hovering, ordered(WAIT, view(pilot))).phase is Phase.HANDED_OVER
    assert after(hovering, ordered(WAIT, view(fault=SILENT))).phase is Phase.HOLD
    late = view(time_s=91.0 + PLAN.time_limit_s)
    assert after(hovering, ordered(WAIT, late)).phase is Phase.LAND


def test_landing_as_ordered_completes_the_flight() -> None:
    landing = after(replace(flying(Phase.HOVER), obeyed=3), ordered(LAND))
    flight, action = step(landing, ordered(LAND), PLAN)
    assert asks(action) is CommandKind.LAND
    assert after(flight, ordered(LAND, view(ON_GROUND))).completed

"""What goes wrong in flight, and that each ends in its written reaction (docs/faults.md)."""

import pytest

from companion.pdps.flight import Phase
from sitl.autopilot.ardupilot import LAND, LOITER
from sitl.testing import Flight, Sitl, at, break_bus, crash, link_down, pilot_mode, unplug


def phase(flight: Flight) -> Phase:
    return flight.app.flight.phase


def test_a_pilot_takes_over_and_the_companion_falls_silent(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, pilot_mode("LOITER"))])
    assert phase(flight) is Phase.HANDED_OVER
    assert flight.ending == "handed over: mode changed to LOITER"
    assert flight.simulation.time_s < 31.5  # HEARTBEAT tells it at once
    assert flight.simulation.autopilot.mode == LOITER
    assert flight.plan.walls


def test_a_link_lost_for_five_seconds_lands_the_drone(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, link_down(for_s=5))])
    assert phase(flight) is Phase.DONE
    assert flight.ending == "landed: the autopilot is silent"
    assert flight.simulation.autopilot.mode == LAND
    assert flight.truth.collisions == 0
    assert flight.plan.walls


def test_a_short_silence_only_holds_the_drone(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, link_down(for_s=1.8))])
    assert flight.completed, flight.ending


def test_a_link_lost_for_good_is_given_up_with_the_drone_at_rest(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, link_down())])
    assert phase(flight) is Phase.FAILED
    assert "nothing heard" in flight.ending
    assert flight.simulation.time_s < 42
    north, east, _ = flight.simulation.autopilot.truth.velocity_ned_m_s
    assert abs(north) + abs(east) < 0.2


def test_a_closed_sensor_bus_lands_the_drone(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, break_bus())])
    assert phase(flight) is Phase.DONE
    assert "silent" in flight.ending or "failed" in flight.ending
    assert flight.truth.collisions == 0
    assert flight.plan.walls


def test_a_bus_that_comes_back_lets_the_flight_go_on(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, break_bus(for_s=0.9))])
    assert flight.completed, flight.ending


@pytest.mark.parametrize("beam", ["front", "right", "left"])
def test_a_dead_beam_lands_the_drone(sitl: Sitl, beam: str) -> None:
    flight = sitl.fly("room_100", script=[at(30, unplug(beam))])
    assert phase(flight) is Phase.DONE
    assert flight.ending == f"landed: range sensor failed: {beam}"
    assert flight.truth.collisions == 0


def test_a_crash_fails_the_flight(sitl: Sitl) -> None:
    flight = sitl.fly("room_100", script=[at(30, crash())])
    assert phase(flight) is Phase.FAILED
    assert flight.ending == "failed: the autopilot disarmed in the air"

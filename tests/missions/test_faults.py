"""What goes wrong in flight, and that each ends in its written reaction (docs/faults.md)."""

import pytest

from companion.pdps.flight import Phase
from sitl.autopilot.ardupilot import LAND, LOITER
from sitl.lockstep import Script
from sitl.simulation import Simulation
from tests.conftest import Fly


def between(start_s: float, end_s: float, begin: Script, finish: Script) -> Script:
    """Begin at one time, finish at another."""
    done = {"begun": False, "finished": False}

    def script(simulation: Simulation) -> None:
        if simulation.time_s >= start_s and not done["begun"]:
            begin(simulation)
            done["begun"] = True
        if simulation.time_s >= end_s and not done["finished"]:
            finish(simulation)
            done["finished"] = True

    return script


def nothing(simulation: Simulation) -> None:
    """It stays so."""


def at(time_s: float, begin: Script) -> Script:
    return between(time_s, float("inf"), begin, nothing)


def link_down(simulation: Simulation) -> None:
    simulation.is_link_down = True


def link_up(simulation: Simulation) -> None:
    simulation.is_link_down = False


def break_bus(simulation: Simulation) -> None:
    simulation.board.bus.is_broken = True


def mend_bus(simulation: Simulation) -> None:
    simulation.board.bus.is_broken = False


def test_a_pilot_takes_over_and_the_companion_falls_silent(fly: Fly) -> None:
    app, simulation = fly(script=at(30, lambda sim: sim.autopilot.pilot_mode(LOITER)))
    assert app.flight.phase is Phase.HANDED_OVER
    assert app.flight.trouble == "mode changed to LOITER"
    assert simulation.time_s < 31.5  # HEARTBEAT tells it at once
    assert simulation.autopilot.mode == LOITER
    assert app.final_floor_plan().walls


def test_a_link_lost_for_five_seconds_lands_the_drone(fly: Fly) -> None:
    app, simulation = fly(script=between(30, 35, link_down, link_up))
    assert app.flight.phase is Phase.DONE
    assert app.flight.trouble == "the autopilot is silent"
    assert simulation.autopilot.mode == LAND
    assert simulation.record.collisions == 0
    assert app.final_floor_plan().walls


def test_a_short_silence_only_holds_the_drone(fly: Fly) -> None:
    app, simulation = fly(script=between(30, 31.8, link_down, link_up))
    assert app.flight.completed, app.flight.ending
    assert simulation.record.collisions == 0


def test_a_link_lost_for_good_is_given_up_with_the_drone_at_rest(fly: Fly) -> None:
    app, simulation = fly(script=at(30, link_down))
    assert app.flight.phase is Phase.FAILED
    assert "nothing heard" in app.flight.trouble
    assert simulation.time_s < 42
    north, east, _ = simulation.autopilot.truth.velocity_ned_m_s
    assert abs(north) + abs(east) < 0.2


def test_a_closed_sensor_bus_lands_the_drone(fly: Fly) -> None:
    app, simulation = fly(script=at(30, break_bus))
    assert app.flight.phase is Phase.DONE
    assert "silent" in app.flight.trouble or "failed" in app.flight.trouble
    assert simulation.record.collisions == 0
    assert app.final_floor_plan().walls


def test_a_bus_that_comes_back_lets_the_flight_go_on(fly: Fly) -> None:
    app, simulation = fly(script=between(30, 30.9, break_bus, mend_bus))
    assert app.flight.completed, app.flight.ending
    assert simulation.record.collisions == 0


@pytest.mark.parametrize("beam", ["front", "right", "left"])
def test_a_dead_beam_lands_the_drone(fly: Fly, beam: str) -> None:
    def unplug(simulation: Simulation) -> None:
        simulation.board.unplug(beam)

    app, simulation = fly(script=at(30, unplug))
    assert app.flight.phase is Phase.DONE
    assert app.flight.trouble == f"range sensor failed: {beam}"
    assert simulation.record.collisions == 0


def test_a_crash_fails_the_flight(fly: Fly) -> None:
    app, _ = fly(script=at(30, lambda sim: sim.autopilot.crash("test")))
    assert app.flight.phase is Phase.FAILED
    assert app.flight.trouble == "the autopilot disarmed in the air"

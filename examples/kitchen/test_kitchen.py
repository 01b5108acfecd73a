"""Tests that the companion maps the kitchen, and reacts safely to faults."""

from sitl.testing import Sitl, at, link_down, pilot_mode, when


def test_kitchen(sitl: Sitl) -> None:
    flight = sitl.fly("kitchen.toml", mission="room", seed=3)
    assert flight.completed, flight.ending
    assert flight.report.coverage > 0.95
    assert flight.report.wall_error_aligned_cm < 10


def test_the_pilot_gets_the_drone(sitl: Sitl) -> None:
    flight = sitl.fly("kitchen.toml", script=[when("scanning", pilot_mode("LOITER"))])
    assert flight.ending == "handed over: mode changed to LOITER"


def test_a_lost_link_lands_the_drone(sitl: Sitl) -> None:
    flight = sitl.fly("kitchen.toml", script=[at(20, link_down(for_s=5))])
    assert "silent" in flight.ending
    assert flight.truth.collisions == 0


def test_a_careful_flight_survives_a_short_gap_in_the_link(sitl: Sitl) -> None:
    flight = sitl.fly("kitchen.toml", mission="careful.toml")
    assert flight.completed, flight.ending
    assert flight.report.clearance_m > 0.3

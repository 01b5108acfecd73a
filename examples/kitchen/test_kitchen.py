"""Test that the companion maps the kitchen, and reacts to faults as documented.

Run with `pytest examples/kitchen`. The fixture `sitl` comes with the package.
"""

from sitl.testing import Sitl, at, link_down, pilot_mode, when


def test_kitchen(sitl: Sitl) -> None:
    flight = sitl.fly("kitchen.toml", mission="room", seed=3)
    assert flight.completed, flight.ending
    assert flight.report.coverage > 0.95
    assert flight.report.wall_error_aligned_cm < 10


def test_the_companion_hands_over_to_the_pilot(sitl: Sitl) -> None:
    flight = sitl.fly("kitchen.toml", script=[when("scanning", pilot_mode("LOITER"))])
    assert flight.ending == "handed over: mode changed to LOITER"


def test_a_lost_link_lands_the_drone(sitl: Sitl) -> None:
    flight = sitl.fly("kitchen.toml", script=[at(20, link_down(for_s=5))])
    assert "silent" in flight.ending
    assert flight.truth.collisions == 0


def test_a_short_link_loss_does_not_end_the_mission(sitl: Sitl) -> None:
    flight = sitl.fly("kitchen.toml", mission="careful.toml")
    assert flight.completed, flight.ending
    assert flight.report.clearance_m > 0.3

"""Tests of furnished rooms: objects a few centimetres thick are neither hit nor mismapped."""

from pathlib import Path

import numpy as np
import pytest

from companion.app import App
from sitl.simulation.simulation import Simulation
from sitl.testing import Sitl, watch
from tests.maps import WALL, Shades, cells, nothing, room, write

CHAIRS_AND_TABLE_M = (
    *((3.1, 2.9), (3.1, 3.3), (3.5, 2.9), (3.5, 3.3)),
    *((4.7, 3.3), (4.7, 3.7), (5.1, 3.3), (5.1, 3.7)),
    *((3.7, 4.5), (3.7, 5.7), (4.5, 4.5), (4.5, 5.7)),
)


def leg(shades: Shades, north_m: float, east_m: float) -> None:
    """Draw a leg as one cell of 5 cm."""
    shades[cells(north_m), cells(east_m)] = WALL


def poles() -> Shades:
    """Twelve poles, 1.5 m apart, in 8 × 7 m."""
    shades = nothing(10, 9)
    room(shades, 1, 1, 9, 8)
    for row in range(4):
        for column in range(3):
            leg(shades, 2.8 + 1.5 * row - 0.2 * (column % 2), 3.0 + 1.5 * column)
    return shades


def chair_legs() -> Shades:
    """Legs of two chairs and a table, in 6 × 6 m."""
    shades = nothing(8, 8)
    room(shades, 1, 1, 7, 7)
    for place in CHAIRS_AND_TABLE_M:
        leg(shades, *place)
    return shades


def lived_in() -> Shades:
    """Seventy legs in a band along two walls of 5.5 × 5.5 m."""
    shades = nothing(8, 8)
    room(shades, 1, 1, 6.5, 6.5)
    rng = np.random.default_rng(7)
    for along_m, from_wall_m in rng.uniform((1.1, 0.1), (6.4, 1.9), (35, 2)):
        leg(shades, along_m, 1 + from_wall_m)
    for along_m, from_wall_m in rng.uniform((1.1, 0.1), (6.4, 1.9), (35, 2)):
        leg(shades, 6.5 - from_wall_m, along_m)
    return shades


@pytest.mark.parametrize("seed", [1, 2])
def test_the_drone_does_not_hit_isolated_poles(sitl: Sitl, tmp_path: Path, seed: int) -> None:
    flight = sitl.fly(write(tmp_path, poles()), mission="building", seed=seed)
    assert flight.completed, flight.ending
    assert flight.report.collisions == 0
    assert flight.report.clearance_m > 0.1


def test_walls_behind_chair_and_table_legs_are_mapped(sitl: Sitl, tmp_path: Path) -> None:
    flight = sitl.fly(write(tmp_path, chair_legs()), mission="building")
    assert flight.completed, flight.ending
    assert flight.report.collisions == 0
    assert flight.report.false_walls < 0.02
    assert flight.report.wall_error_aligned_cm < 5


def test_beams_that_sweep_over_legs_raise_no_sensor_fault(sitl: Sitl, tmp_path: Path) -> None:
    troubles = set()

    def note(_: Simulation, app: App) -> None:
        troubles.add(app.flight.trouble)

    world = write(tmp_path, lived_in())
    flight = sitl.fly(world, mission="building", script=[watch(note)])
    assert flight.report.collisions == 0
    assert not [trouble for trouble in troubles if "sensor" in trouble]

"""Beams that pass through a wall are evidence against it, flight by flight and level by level."""

import numpy as np
import pytest

from companion.core.arrays import Array, Mask
from companion.estimation.association.see_through import passages, passed_through
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.estimation.smoothing.state import CALIBRATION_SIZE, Rays, Unknowns

SIGMA_M, OPENING_M = 0.02, 0.5
AT_M, BEHIND_M = 2.0, 4.0
"""North of the wall, and of what stands behind it."""


def wall(flights: int) -> Unknowns:
    """One wall from west to east."""
    calibration = np.zeros((flights, CALIBRATION_SIZE))
    lines, reach_m = np.array([[0.0, AT_M]]), np.array([[0.0, 8.0]])
    return Unknowns(np.zeros((1, 6)), lines, reach_m, calibration)


def refuted(seen: list[tuple[int, int, Array, float]], flights: int) -> tuple[Mask, int]:
    """Hits on the wall that are refuted, and passages.

    `seen`: flight, level, east of the beams (n,) to the north, and where they ended, m.
    """
    east_m = np.concatenate([each for _, _, each, _ in seen])
    flight, level, north_m = (
        np.concatenate([np.full(len(each[2]), each[i]) for each in seen]) for i in (0, 1, 3)
    )
    origins = np.column_stack([np.zeros_like(east_m), east_m])
    points = np.column_stack([north_m, east_m])
    rays = Rays(origins, np.tile([1.0, 0.0], (len(east_m), 1)), points, flight, level)
    wall_of = np.where(north_m == AT_M, 0, NO_WALL)
    given = wall(flights), rays, np.full(len(east_m), SIGMA_M), wall_of, OPENING_M
    return passed_through(*given)[wall_of == 0], int(passages(*given).sum())


@pytest.mark.parametrize("flights", [1, 10])
def test_a_line_through_outliers_is_refuted_by_the_beams_that_passed(flights: int) -> None:
    """Ten flights drew walls through hits that each flight alone had not taken for a wall."""
    draw = np.random.default_rng(flights)
    seen = []
    for flight in range(flights):
        seen.append((flight, 0, draw.uniform(0, 8, 80 // flights), AT_M))
        seen.append((flight, 0, draw.uniform(0, 8, 300), BEHIND_M))
    wrong, through = refuted(seen, flights)
    assert wrong.mean() > 0.8
    assert through > 100


def test_a_door_that_was_shut_is_a_wall_for_the_flight_that_found_it_shut() -> None:
    east_m = np.linspace(0, 1, 30)
    wrong, through = refuted([(0, 0, east_m, BEHIND_M), (1, 0, east_m, AT_M)], 2)
    assert not wrong.any()
    assert through == 0


@pytest.mark.parametrize(("level", "is_refuted"), [(0, True), (1, False)])
def test_a_low_wall_is_not_refuted_by_beams_above_it(level: int, *, is_refuted: bool) -> None:
    east_m = np.linspace(0, 1, 30)
    wrong, _ = refuted([(0, level, east_m, BEHIND_M), (0, 0, east_m, AT_M)], 1)
    assert (wrong.mean() > 0.8) == is_refuted
    assert wrong.any() == is_refuted

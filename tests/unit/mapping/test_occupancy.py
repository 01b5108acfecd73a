"""Occupancy grid: free, occupied and unknown cells are distinct."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.mapping.joined_grid import AllowedAbove, JoinedGrid, allowed_above, joined
from companion.mapping.occupancy import CELL_M, Occupancy
from companion.mapping.rays import Ray
from tests.grids import sweep_round

PLACE = st.tuples(st.floats(-30, 30), st.floats(-30, 30))


def state(grid: Occupancy, place: tuple[float, float]) -> str:
    row, column = grid.cell(place)
    if not (0 <= row < grid.shape[0] and 0 <= column < grid.shape[1]):
        return "unknown"
    if grid.occupied[row, column]:
        return "occupied"
    return "free" if grid.free[row, column] else "unknown"


def seen(grid: Occupancy, ray: Ray, times: int = 3) -> Occupancy:
    for _ in range(times):
        grid.add(ray)
    return grid


@given(PLACE, st.floats(-math.pi, math.pi), st.floats(0.5, 5))
def test_cells_before_a_hit_are_free_and_cells_behind_it_unknown(
    origin: tuple[float, float], bearing_rad: float, end_m: float
) -> None:
    grid = seen(Occupancy(), Ray(origin, bearing_rad, end_m, 0.01, True, 0.0))
    along = math.cos(bearing_rad), math.sin(bearing_rad)

    def at(metres: float) -> tuple[float, float]:
        return origin[0] + metres * along[0], origin[1] + metres * along[1]

    assert state(grid, at(end_m)) == "occupied"
    assert "free" in {state(grid, at(end_m / 2 + aside)) for aside in (-0.05, 0.0, 0.05)}
    assert state(grid, at(end_m + 2 * CELL_M)) == "unknown"


def test_a_beam_without_a_hit_frees_cells_and_fills_none() -> None:
    grid = seen(Occupancy(), Ray((0, 0), 0.0, 4.0, 0.0, False, 0.0))
    assert state(grid, (3.9, 0)) == "free"
    assert not grid.occupied.any()


def test_a_reading_with_a_large_sigma_fills_no_cell() -> None:
    grid = seen(Occupancy(), Ray((0, 0), 0.0, 5.0, 0.18, True, 0.0))
    assert not grid.occupied.any()
    assert state(grid, (2, 0)) == "free"


def test_the_cell_of_a_moved_obstacle_becomes_free() -> None:
    grid = seen(Occupancy(), Ray((0, 0), 0.0, 2.0, 0.02, True, 0.0))
    assert state(grid, (2, 0)) == "occupied"
    seen(grid, Ray((0, 0), 0.0, 4.0, 0.02, True, 0.0), times=20)
    assert state(grid, (2, 0)) == "free"


@given(PLACE)
def test_cell_and_place_are_inverse_functions(place: tuple[float, float]) -> None:
    grid = Occupancy()
    assert grid.cell(grid.place(grid.cell(place))) == grid.cell(place)
    assert math.dist(grid.place(grid.cell(place)), place) <= CELL_M


def test_nearest_m_is_the_distance_to_the_nearest_obstacle() -> None:
    grid = seen(Occupancy(), Ray((0, 0), 0.0, 2.0, 0.02, True, 0.0))
    assert grid.nearest_m((1.4, 0.0), 1.0) == pytest.approx(0.6, abs=0.15)
    assert grid.nearest_m((-5.0, 0.0), 1.0) == 1.0


def test_what_another_drone_has_measured_counts_where_the_own_map_is_unknown() -> None:
    """This drone sees a wall at 2 m to the north; the other one flies higher, and sees over it."""
    own = seen(Occupancy(), Ray((0.0, 0.0), 0.0, 2.0, 0.01, True, 5.0))
    other = seen(Occupancy(), Ray((0.0, 0.0), 0.0, 8.0, 0.01, True, 1.0))
    union = joined(own, [other])
    assert state(union, (1.0, 0.0)) == "free"
    assert state(union, (2.0, 0.0)) == "occupied"
    assert state(union, (5.0, 0.0)) == "free"
    assert state(union, (8.0, 0.0)) == "occupied"
    assert state(own, (5.0, 0.0)) == "unknown"
    _, met_s = union.met_near((2.0, 0.0), 0.3)
    assert met_s.max() == 5.0
    _, met_s = union.met_near((8.0, 0.0), 0.3)
    assert met_s.max() == -math.inf


def test_a_joined_map_follows_each_change_of_its_grids() -> None:
    own, other, union = Occupancy(), Occupancy(), JoinedGrid()
    assert state(union.of(own, [other]), (2.0, 0.0)) == "unknown"
    seen(own, Ray((0.0, 0.0), 0.0, 2.0, 0.01, True, 5.0))
    assert state(union.of(own, [other]), (2.0, 0.0)) == "occupied"
    seen(other, Ray((0.0, 0.0), math.pi, 2.0, 0.01, True, 5.0))
    assert state(union.of(own, [other]), (-2.0, 0.0)) == "occupied"
    other.block((0.0, 3.0), 0.1)
    assert state(union.of(own, [other]), (0.0, 3.0)) == "occupied"
    assert state(union.of(own, []), (0.0, 3.0)) == "unknown"
    assert state(union.of(own, [other.copy()]), (0.0, 3.0)) == "occupied"


@given(st.lists(st.tuples(PLACE, st.floats(-math.pi, math.pi), st.floats(0.5, 5)), max_size=6))
def test_a_joined_map_contains_the_own_map(
    rays: list[tuple[tuple[float, float], float, float]],
) -> None:
    own = Occupancy()
    for origin, bearing_rad, end_m in rays[::2]:
        seen(own, Ray(origin, bearing_rad, end_m, 0.01, True, 1.0))
    other = Occupancy()
    for origin, bearing_rad, end_m in rays[1::2]:
        seen(other, Ray(origin, bearing_rad, end_m, 0.01, True, 1.0))
    union = joined(own, [other])
    for row in range(0, own.shape[0], 7):
        for column in range(0, own.shape[1], 7):
            place = own.place((row, column))
            if state(own, place) != "unknown":
                assert state(union, place) == state(own, place)


def swept(*places: tuple[float, float], hit: bool = False) -> Occupancy:
    """Discs of free space of 2 m."""
    grid = Occupancy()
    for place in places:
        sweep_round(grid, place, 2.0, hit=hit)
    return grid


def test_a_layer_may_be_flown_above_free_space_of_the_lowest() -> None:
    """The layer between was not begun: a team begins at the lowest and at the highest."""
    grid = allowed_above((swept((0.0, 0.0)), Occupancy(), Occupancy()), (), lambda _: ())
    assert grid.allowed[grid.cell((1.0, 0.0))]
    assert not grid.allowed[grid.cell((3.0, 0.0))]


def test_what_stands_in_any_layer_below_or_hangs_low_forbids_a_place() -> None:
    shelf = seen(Occupancy(), Ray((0.0, 0.0), 0.0, 1.0, 0.01, True, 1.0))
    layers = swept((0.0, 0.0)), shelf, Occupancy()
    grid = allowed_above(layers, (), lambda layer: ((-1.0, 0.0),) if layer == 2 else ())
    assert not grid.allowed[grid.cell((1.0, 0.0))]
    assert not grid.allowed[grid.cell((-1.0, 0.0))]
    assert grid.allowed[grid.cell((0.0, 1.0))]


def test_above_a_layer_that_was_seen_only_its_free_space_may_be_flown() -> None:
    layers = swept((0.0, 0.0), (0.0, 3.0)), swept((0.0, 0.0)), Occupancy()
    for was_seen, is_allowed in (((), True), ((1,), False)):
        grid = allowed_above(layers, was_seen, lambda _: ())
        assert grid.allowed[grid.cell((0.0, 3.5))] == is_allowed


def test_a_doorway_of_the_lowest_layer_is_shut_above_until_that_was_seen() -> None:
    """No drone may have passed below its lintel yet."""
    rooms = swept((0.0, 0.0), (5.0, 0.0))
    for east_m in np.arange(-0.4, 0.41, 0.1).tolist():
        seen(rooms, Ray((0.0, east_m), 0.0, 5.0, 0.01, False, 0.0))
    for was_seen in ((), (0,)):
        grid = allowed_above((rooms, Occupancy()), was_seen, lambda _: ())
        assert grid.allowed[grid.cell((0.0, 0.0))]
        assert grid.allowed[grid.cell((5.0, 0.0))]
        assert grid.allowed[grid.cell((2.5, 0.0))] == bool(was_seen)


def test_in_flight_a_layer_follows_those_below_what_was_seen_and_what_hangs_low() -> None:
    above = AllowedAbove()
    low: tuple[tuple[float, float], ...] = ()

    def is_allowed(layers: tuple[Occupancy, ...], was_seen: tuple[int, ...] = ()) -> bool:
        grid = above.of(layers, was_seen, lambda _: low)
        assert grid is above.of(layers, was_seen, lambda _: low)
        return bool(grid.allowed[grid.cell((0.0, 3.5))])

    highest = Occupancy()
    wide, narrow = swept((0.0, 0.0), (0.0, 3.0)), swept((0.0, 0.0))
    assert not is_allowed((narrow, highest))
    assert is_allowed((wide, highest))
    assert is_allowed((wide, narrow, highest))
    assert not is_allowed((wide, narrow, highest), (1,))
    low = ((0.0, 3.5),)
    assert not is_allowed((wide, highest))

"""Tests the search for where a flight began, over the full circle."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.arrays import Array
from companion.core.frames import inverse_starts, moved, wrap_rad
from companion.survey.evidence import Sight, evidence
from companion.survey.unknown_start import candidates, different_places, is_same, search_start
from tests.examples import examples
from tests.unit.survey.rooms import (
    L_PATH,
    L_SHAPE,
    RECTANGLE,
    SQUARE,
    Corners,
    inside,
    seen,
    sides,
)

ORIGIN = np.zeros(3)
ELSEWHERE = np.array([3.0, -2.0, math.radians(130)])
STARTS = st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(-math.pi, math.pi)).map(
    np.array
)
"""Starts of a flight in the frame of the building."""


def l_shape(start: Array, seed: int = 0) -> Sight:
    return seen(sides(L_SHAPE), [L_PATH], start, seed)


def rectangle(corners: Corners, start: Array, seed: int = 0) -> Sight:
    return seen(sides(corners), [inside(corners)], start, seed)


def shape_with_alcove(start: Array, seed: int = 0) -> Sight:
    """A rectangle with an alcove, 1.2 m wide and 0.6 m deep, in the middle of a side."""
    corners = ((0, 0), (7, 0), (7, 5), (4.1, 5), (4.1, 5.6), (2.9, 5.6), (2.9, 5), (0, 5))
    return seen(sides(corners), [inside(RECTANGLE)], start, seed)


@settings(max_examples=examples(20))
@given(STARTS, STARTS)
def test_the_start_in_a_room_without_symmetry_is_found_in_any_frame(
    first: Array, second: Array
) -> None:
    found = search_start(l_shape(second, seed=1), l_shape(first)).found
    assert found is not None
    north_m, east_m, yaw_rad = found.start.tolist()
    place = moved((first[0], first[1]), (north_m, east_m), first[2])
    assert place == pytest.approx(second[:2], abs=0.1)
    assert wrap_rad(first[2] + yaw_rad - second[2]) == pytest.approx(0, abs=math.radians(1))


@settings(max_examples=examples(20))
@given(STARTS)
def test_swapped_flights_agree(start: Array) -> None:
    one, other = l_shape(ORIGIN), l_shape(start, seed=1)
    there, back = search_start(one, other).found, search_start(other, one).found
    assert there is not None
    assert back is not None
    assert is_same(inverse_starts(back.start[None])[0], there.start)
    assert there.agreed_m == pytest.approx(back.agreed_m, abs=1.0)


@pytest.mark.parametrize(("corners", "ways"), [(RECTANGLE, 2), (SQUARE, 4)])
def test_a_symmetric_room_is_ambiguous_and_all_starts_are_named(
    corners: Corners, ways: int
) -> None:
    search = search_start(rectangle(corners, ELSEWHERE, 1), rectangle(corners, ORIGIN))
    assert search.found is None
    assert search.reason.startswith(f"{ways} starts fit equally: ")
    assert "3.0 m north, 2.0 m west, heading +130°" in search.reason
    assert search.reason.count("heading") == ways


def test_free_space_decides_where_a_room_is_nearly_symmetric() -> None:
    search = search_start(shape_with_alcove(ELSEWHERE, 1), shape_with_alcove(ORIGIN))
    assert search.found is not None
    assert is_same(search.found.start, ELSEWHERE)


def test_a_refuted_start_gives_way_to_the_next() -> None:
    one, other = rectangle(RECTANGLE, ELSEWHERE, 1), rectangle(RECTANGLE, ORIGIN)
    search = search_start(one, other, refuted=[ELSEWHERE])
    assert search.found is not None
    turned = np.array([7 - 3.0, 5 + 2.0, ELSEWHERE[2] + math.pi])
    assert is_same(search.found.start, turned)


@pytest.mark.parametrize(
    "corners", [((0, 0), (7, 0), (7, 4), (0, 4)), ((0, 0), (9, 0), (9, 8), (0, 8))]
)
def test_a_room_of_another_size_fits_nowhere(corners: Corners) -> None:
    search = search_start(rectangle(corners, ORIGIN), l_shape(ORIGIN))
    assert search.found is None
    assert "overlap" in search.reason or search.reason.startswith("no start fits")


def test_a_corner_alone_is_too_little_overlap() -> None:
    corner = seen(sides(RECTANGLE)[:2], [((6, 1), (6, 4))], ORIGIN)
    search = search_start(corner, l_shape(ORIGIN))
    assert search.found is None
    assert search.reason.startswith("too little overlap")


def test_a_corridor_without_its_ends_is_too_little_overlap() -> None:
    walls = np.array([[[0, 0], [12, 0]], [[0, 2], [12, 2]]])
    corridor = seen(walls, [((3, 1), (9, 1))], ORIGIN)
    search = search_start(corridor, corridor)
    assert search.found is None
    assert search.reason.startswith("too little overlap")


def test_a_flight_without_walls_has_no_start() -> None:
    nothing = seen(sides(RECTANGLE) + 100, [((6, 1), (6, 4))], ORIGIN)
    assert search_start(nothing, l_shape(ORIGIN)).found is None
    assert search_start(l_shape(ORIGIN), nothing).reason.startswith("too little overlap")


def test_two_equal_rooms_are_two_places_and_a_turned_room_is_one() -> None:
    room = np.concatenate([sides(L_SHAPE), sides(L_SHAPE) + np.array([0.0, 8.0])])
    paths = [L_PATH, [(north, east + 8) for north, east in L_PATH]]
    both, one = seen(room, paths, ORIGIN), l_shape(ELSEWHERE, 1)
    possible = candidates(one, both)
    assert len(different_places(possible, one, possible[0].score_m)) == 2
    turned = rectangle(RECTANGLE, ELSEWHERE, 1)
    possible = candidates(turned, rectangle(RECTANGLE, ORIGIN))
    assert len(different_places(possible, turned, possible[0].score_m)) == 1


def test_parallel_walls_agree_but_do_not_determine_a_place_along_them() -> None:
    walls = np.array([[[0, 0], [12, 0]], [[0, 2], [12, 2]]])
    corridor = seen(walls, [((3, 1), (9, 1))], ORIGIN)
    found = evidence(corridor, corridor, np.zeros((1, 3)))
    assert found.agreed_m[0] > 10
    assert found.across_m[0] == pytest.approx(0.0, abs=1e-6)


def test_a_wall_in_the_free_space_of_the_other_map_contradicts() -> None:
    one, other = rectangle(((0, 0), (7, 0), (7, 3), (0, 3)), ORIGIN), rectangle(SQUARE, ORIGIN)
    for found in (
        evidence(one, other, np.zeros((1, 3))),
        evidence(other, one, np.zeros((1, 3))),
    ):
        assert found.contradicted_m[0] > 1.0

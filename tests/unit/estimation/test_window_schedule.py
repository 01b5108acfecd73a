"""Tests which part of a growing flight is solved."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from companion.estimation.smoothing.window_schedule import (
    GROWN_BY,
    MAX_PART_KEYFRAMES,
    OVERLAP_KEYFRAMES,
    WindowSchedule,
    prior_frame,
)

LENGTHS = st.lists(st.integers(1, 60), min_size=1, max_size=200)
"""Keyframes by which a flight grows between two solutions."""


def solved(growth: list[int], schedule: WindowSchedule) -> list[tuple[int, int]]:
    """First keyframe and length of the flight at every solution."""
    solutions, keyframes, prior = [], 0, 0
    for added in growth:
        keyframes += added
        is_whole = schedule.is_whole(keyframes)
        first = 0 if is_whole else prior
        solutions.append((first, keyframes))
        moved = prior_frame(keyframes - first, is_whole=is_whole)
        if moved is not None:
            prior = first + moved
            if is_whole:
                schedule.solved_whole(keyframes)
    return solutions


@given(LENGTHS, st.integers(0, 300))
def test_a_short_flight_is_solved_as_a_whole(growth: list[int], short: int) -> None:
    solutions = solved(growth, WindowSchedule(short))
    assert all(first == 0 for first, keyframes in solutions if keyframes < short)


@given(LENGTHS)
def test_every_solution_overlaps_the_one_before(growth: list[int]) -> None:
    for (_, before), (first, _) in pairwise(solved(growth, WindowSchedule(0))):
        assert first <= max(before - OVERLAP_KEYFRAMES, 0)


@given(LENGTHS)
def test_the_whole_is_solved_each_time_it_has_grown(growth: list[int]) -> None:
    solutions = solved(growth, WindowSchedule(0))
    wholes = [keyframes for first, keyframes in solutions if first == 0]
    for whole, later in pairwise([*wholes, solutions[-1][1]]):
        assert later <= GROWN_BY * max(whole, OVERLAP_KEYFRAMES) + max(growth)


@given(LENGTHS, st.integers(300, 2000))
def test_solutions_of_a_long_flight_are_bounded(growth: list[int], longest: int) -> None:
    for first, keyframes in solved(growth, WindowSchedule(150, longest)):
        limit = longest if first == 0 else MAX_PART_KEYFRAMES + max(growth)
        assert keyframes - first <= limit

"""Tests who moves when drones of a team do not know where the others are."""

from collections.abc import Set
from itertools import combinations

from hypothesis import given
from hypothesis import strategies as st

from companion.team.silence import (
    HOLDS_S,
    LANDS_S,
    Right,
    Silent,
    must_land,
    reached,
    right_to_move,
)

Pair = tuple[int, int]


def rights(drones: int, links: Set[Pair], now_s: float) -> dict[int, Right]:
    """What each drone may do when only these pairs hear each other from 0 s on."""
    numbers = range(1, drones + 1)

    def hears(one: int, other: int) -> bool:
        return (min(one, other), max(one, other)) in links

    tables: dict[int, dict[int, int]] = {number: {} for number in numbers}
    for _ in numbers:
        tables = {
            own: reached({each: tables[each] for each in numbers if hears(own, each)}, own)
            for own in numbers
        }
    return {
        own: right_to_move(
            own,
            now_s,
            {
                each: Silent(0.0, goes_home=False)
                for each in numbers
                if each != own and not hears(own, each)
            },
            tables[own],
        )
        for own in numbers
    }


@given(st.data(), st.integers(2, 6), st.sampled_from([3.0, HOLDS_S - 1, HOLDS_S + 1]))
def test_of_two_drones_that_do_not_hear_each_other_only_one_moves(
    data: st.DataObject, drones: int, now_s: float
) -> None:
    """Also one that must be home by now does not move."""
    pairs = list(combinations(range(1, drones + 1), 2))
    links = data.draw(st.sets(st.sampled_from(pairs)))
    right = rights(drones, links, now_s)
    moving = {own for own, may in right.items() if not may.holds and now_s < may.home_by_s}
    for one, other in set(pairs) - links:
        assert not {one, other} <= moving
        if now_s < HOLDS_S:
            assert (one in right[other].others_hold) <= right[one].holds


def test_most_of_a_team_fly_on_without_one_that_is_silent() -> None:
    """The first of four has crashed, or its radio has failed. Then it holds its place."""
    right = rights(4, {(2, 3), (3, 4), (2, 4)}, 10.0)
    assert right[1].holds
    for own in (2, 3, 4):
        assert right[own] == Right(others_hold=frozenset({1}))


def test_the_drones_of_a_chain_know_of_each_other() -> None:
    """The first and the last of four do not hear each other; the last waits for those before."""
    right = rights(4, {(1, 2), (2, 3), (3, 4)}, 10.0)
    assert [right[own].holds for own in (1, 2, 3, 4)] == [False, False, True, True]


def test_a_broken_way_is_forgotten() -> None:
    """Two drones that tell each other of a third that neither hears."""
    first, second = {2: 1, 3: 2}, {1: 1, 3: 1}
    for _ in range(8):
        first, second = reached({2: second}, 1), reached({1: first}, 2)
    assert (first, second) == ({2: 1}, {1: 1})


def test_a_drone_waits_for_one_that_flies_home_until_it_must_be_down() -> None:
    silent = {2: Silent(0.0, goes_home=True)}
    assert right_to_move(1, LANDS_S - 1, silent, ()).holds
    assert not right_to_move(1, LANDS_S + 1, silent, ()).holds


def test_of_two_drones_whose_maps_contradict_each_other_the_second_lands() -> None:
    assert not must_land(1, (), {2})
    assert must_land(2, (), {1})


@given(st.integers(2, 6), st.data())
def test_the_drone_that_contradicts_all_others_lands_and_they_fly_on(
    drones: int, data: st.DataObject
) -> None:
    wrong = data.draw(st.integers(1, drones)) if drones > 2 else 2
    others = set(range(1, drones + 1)) - {wrong}
    assert must_land(wrong, (), others)
    for own in others:
        assert not must_land(own, others - {own}, {wrong})


def test_a_drone_that_agrees_with_all_flies_on() -> None:
    assert not must_land(2, {1, 3}, ())
    assert not must_land(1, (), ())

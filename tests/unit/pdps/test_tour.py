"""The order in which viewpoints are visited."""

from itertools import pairwise, permutations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from companion.pdps.tour import shortest_first


@given(st.integers(1, 5), st.integers(0, 1000))
def test_the_tour_is_the_shortest_of_all(count: int, seed: int) -> None:
    places = np.random.default_rng(seed).uniform(-5, 5, (count + 1, 2))
    between = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    here, home = np.hypot(*places.T)[:-1], between[:-1, -1]

    def length(order: tuple[int, ...]) -> float:
        legs = sum(float(between[a, b]) for a, b in pairwise(order))
        return float(here[order[0]]) + legs + float(home[order[-1]])

    best = min(permutations(range(count)), key=length)
    assert shortest_first(here, between[:-1, :-1], home) == best[0]

"""Levels of flight are found from the heights of the hits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.estimation.smoothing.height_levels import levels


@given(
    heights_m=st.lists(st.sampled_from([1.2, 1.8, 2.4, 3.0]), min_size=1, max_size=4, unique=True),
    hits=st.integers(300, 3000),
    seed=st.integers(0, 2**31),
)
def test_each_hit_is_at_the_level_that_the_drone_flew(
    heights_m: list[float], hits: int, seed: int
) -> None:
    draw = np.random.default_rng(seed)
    heights_m.sort()
    level = np.repeat(np.arange(len(heights_m)), hits)
    flown_m = np.array(heights_m)[level] + draw.uniform(-0.1, 0.1, len(level))
    climbing_m = np.arange(0.3, heights_m[-1], 0.01)
    found = levels(np.concatenate([flown_m, climbing_m]))
    assert found[: len(level)] == pytest.approx(level)
    assert found.max() == len(heights_m) - 1


def test_a_short_climb_and_no_hits_are_one_level() -> None:
    assert not levels(np.concatenate([np.full(500, 1.2), np.linspace(0.3, 1.2, 40)])).any()
    assert not len(levels(np.empty(0)))

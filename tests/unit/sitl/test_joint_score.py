"""The true flights of a team at the times of its joint map."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import cast

from hypothesis import given
from hypothesis import strategies as st

from companion.survey.merge import Merged
from sitl.core.truth import TrueState
from sitl.scoring.joint import together
from sitl.simulation.record import TruthRecord

HERE = TrueState(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)


def recorded(north_m: float, until_s: int) -> TruthRecord:
    """The record of a drone that stays at a place."""
    there = replace(HERE, position_ned_m=(north_m, 0.0, 0.0))
    truth = TruthRecord(there)
    for time_s in range(1, until_s + 1):
        truth.observe(replace(there, time_s=float(time_s)), clearance_m=1.0)
    return truth


def merged(begins_s: Sequence[float]) -> Merged:
    flights = [
        SimpleNamespace(name=f"flight {number}", later_s=begins)
        for number, begins in enumerate(begins_s, 1)
    ]
    return cast(Merged, SimpleNamespace(flights=flights))


@given(first_s=st.integers(1, 60), second_s=st.integers(1, 60), lands_s=st.floats(1.5, 60))
def test_each_drone_has_its_own_time_though_one_lands_earlier(
    first_s: int, second_s: int, lands_s: float
) -> None:
    """The first drone lands at `lands_s`; its record goes on until all have landed."""
    truth = together([recorded(0.0, first_s), recorded(5.0, second_s)], merged([0.0, lands_s]))
    assert all(before.time_s <= after.time_s for before, after in pairwise(truth.path))
    for state in truth.path:
        assert state.position_ned_m[0] == (5.0 if state.time_s >= lands_s else 0.0)

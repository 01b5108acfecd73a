"""Splitting of walls nearly in line that were associated as one wall."""

import math
from collections.abc import Callable, Generator
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.arrays import Indices
from companion.core.messages import BEARING_FRD_RAD, Beam, Pose, RangeUnit
from companion.drivers.chips.sharp import PAPER
from companion.estimation.association.pruning import Support
from companion.estimation.hypotheses.search import HypothesisSearch
from companion.estimation.hypotheses.split_revisits import split_candidates
from companion.estimation.smoothing.estimate import Estimate
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.flight_record import FlightRecord
from companion.estimation.smoothing.range_noise import BEAMS, RangeUnits
from companion.estimation.smoothing.smoother import FINAL_GATES, Smoother, run_to_end
from companion.estimation.smoothing.state import Measured, Unknowns
from tests.examples import examples

EASTWARDS_RAD = math.pi / 2
UNITS = RangeUnits({b: RangeUnit(PAPER, at, 0.0) for b, at in BEARING_FRD_RAD.items()})
SMOOTHER = Smoother(Models(UNITS), Support())
START = SMOOTHER.from_start(np.array([0.0, 0.0, EASTWARDS_RAD]))
KEYFRAMES, DOORWAY = 151, range(60, 90)
STEP_M = 0.1
Search = Callable[[HypothesisSearch, Estimate], Generator[None, None, Estimate]]


def flight_past_two_walls(seed: int, apart_m: float) -> tuple[Measured, Estimate]:
    """Fly 15 m east past a wall 1.5 m north, a gap of 3 m, and a wall `apart_m` further north.

    A third wall runs 1.5 m south. Also returns the solution with the first two as one wall.
    """
    random, record = Random(seed), FlightRecord()
    walk_m = 0.005 * math.sqrt(2)
    north_m = east_m = 0.0
    for k in range(KEYFRAMES):
        pose = Pose(0.2 * k, north_m, east_m, -1.2, EASTWARDS_RAD)
        record.advance(pose, (north_m, east_m), EASTWARDS_RAD)
        wall_m = 1.5 if k < DOORWAY.start else 1.5 + apart_m
        for beam, there_m in ((Beam.LEFT, wall_m), (Beam.RIGHT, 1.5)):
            if beam is Beam.RIGHT or k not in DOORWAY:
                reading_m = there_m + random.gauss(0, 0.05)
                record.add_hit(
                    pose, BEAMS.index(beam), reading_m, ((0.0, 0.0), BEARING_FRD_RAD[beam]), None
                )
        north_m += random.gauss(0, walk_m)
        east_m += STEP_M + random.gauss(0, walk_m)
    m = Measured.of(record, UNITS)
    x = Unknowns.at(record.poses, 0.0)
    x.add_walls(np.array([(0.0, 1.5), (math.pi, 1.5)]), np.array([(-1.0, 16.0), (-16.0, 1.0)]))
    wall_of = np.where(m.beam == BEAMS.index(Beam.LEFT), 0, 1)
    for _ in range(4):
        solution = SMOOTHER.step(x, m, wall_of, START)
    return m, Estimate(x, wall_of, solution)


def suspect_visits(m: Measured, estimate: Estimate) -> list[Indices]:
    work = split_candidates(SMOOTHER, estimate, m, START)
    while True:
        try:
            next(work)
        except StopIteration as end:
            visits: list[Indices] = end.value
            return visits


@settings(max_examples=examples(30))
@given(st.integers(0, 1000))
def test_two_visits_to_one_wall_give_no_split_candidate(seed: int) -> None:
    m, as_one_wall = flight_past_two_walls(seed, 0.0)
    assert not suspect_visits(m, as_one_wall)


@settings(max_examples=examples(30))
@given(st.integers(0, 1000), st.sampled_from([-0.5, -0.4, 0.4, 0.5]))
def test_two_walls_associated_as_one_give_a_split_candidate(seed: int, apart_m: float) -> None:
    m, as_one_wall = flight_past_two_walls(seed, apart_m)
    assert suspect_visits(m, as_one_wall)


@pytest.mark.parametrize(
    "search", [HypothesisSearch.in_flight_search, HypothesisSearch.final_search]
)
def test_the_search_splits_two_walls_that_were_associated_as_one(search: Search) -> None:
    m, as_one_wall = flight_past_two_walls(1, 0.4)
    likelier = run_to_end(search(HypothesisSearch(SMOOTHER, m, START, FINAL_GATES), as_one_wall))
    assert sorted(likelier.x.walls[:, 1]) == pytest.approx([1.5, 1.5, 1.9], abs=0.1)
    assert abs(likelier.x.poses[-1, 0]) < 0.1

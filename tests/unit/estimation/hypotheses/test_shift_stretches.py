"""Detection of stretches of a flight that are offset from the map."""

import math
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.arrays import Array
from companion.core.messages import BEARING_FRD_RAD, Beam, Pose, RangeUnit
from companion.drivers.chips.sharp import PAPER
from companion.estimation.association.pruning import Support
from companion.estimation.hypotheses.shift_stretches import Shift, shifted, shifts
from companion.estimation.smoothing.estimate import Estimate
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.flight_record import FlightRecord
from companion.estimation.smoothing.range_noise import BEAMS, RangeUnits
from companion.estimation.smoothing.smoother import Smoother
from companion.estimation.smoothing.state import Measured, Unknowns
from tests.examples import examples

UNITS = RangeUnits({b: RangeUnit(PAPER, at, 0.0) for b, at in BEARING_FRD_RAD.items()})
SMOOTHER = Smoother(Models(UNITS), Support())
START = SMOOTHER.from_start(np.zeros(3))
WALLS_M = {Beam.FRONT: 2.5, Beam.RIGHT: 5.0, Beam.LEFT: 5.0}
MAX_RANGE_M = 4.0
KEYFRAMES, PERIOD_S = 1500, 0.2
OFFSET_S, RAMP_S = (100.0, 200.0), 60.0


def flight_in_a_room(seed: int, offset_m: float) -> tuple[Measured, Array, Estimate]:
    """Five minutes in a room with hits on three walls; returns the true positions (k, 2), m.

    Also returns a solution in which the stretch `OFFSET_S` is offset to the south, with a wall of
    its own.
    """
    random, record = Random(seed), FlightRecord()
    places = []
    for k in range(KEYFRAMES):
        place = 0.8 * math.sin(0.031 * k), 3.0 * math.sin(0.02 * k)
        places.append(place)
        north_m, east_m = (metres + random.gauss(0, 0.003) for metres in place)
        pose = Pose(PERIOD_S * k, north_m, east_m, -1.2, 0.0)
        record.advance(pose, (north_m, east_m), 0.0)
        aside_m = {Beam.FRONT: place[0], Beam.RIGHT: place[1], Beam.LEFT: -place[1]}
        for beam, wall_m in WALLS_M.items():
            if wall_m - aside_m[beam] < MAX_RANGE_M:
                reading_m = wall_m - aside_m[beam] + random.gauss(0, 0.03)
                mount = (0.0, 0.0), BEARING_FRD_RAD[beam]
                record.add_hit(pose, BEAMS.index(beam), reading_m, mount, None)
    m, x = Measured.of(record, UNITS), Unknowns.at(record.poses, 0.0)
    time_s = PERIOD_S * np.arange(KEYFRAMES)
    begin_s, end_s = OFFSET_S
    corners_s = begin_s - RAMP_S, begin_s, end_s, end_s + RAMP_S
    ramp = np.interp(time_s, corners_s, (0.0, 1.0, 1.0, 0.0))
    x.poses[:, 0] -= offset_m * ramp
    normals_rad = [0.0, math.pi / 2, -math.pi / 2, 0.0]
    offsets_m = [*WALLS_M.values(), WALLS_M[Beam.FRONT] - offset_m]
    x.add_walls(np.column_stack([normals_rad, offsets_m]), np.tile((-4.0, 4.0), (4, 1)))
    wall_of = np.array([list(WALLS_M).index(BEAMS[beam]) for beam in m.beam])
    wall_of[(wall_of == 0) & (ramp[m.frame] > 0.5) & (offset_m != 0)] = 3
    solution = SMOOTHER.step(x.since(0), m, wall_of, START)
    return m, np.array(places), Estimate(x, wall_of, solution)


def found(m: Measured, estimate: Estimate) -> list[Shift]:
    work = shifts(estimate, m, UNITS)
    while True:
        try:
            next(work)
        except StopIteration as end:
            result: list[Shift] = end.value
            return result


@settings(max_examples=examples(10), deadline=None)
@given(st.integers(0, 1000))
def test_a_consistent_flight_has_no_shifts(seed: int) -> None:
    m, _, estimate = flight_in_a_room(seed, 0.0)
    assert not found(m, estimate)


@settings(max_examples=examples(10), deadline=None)
@given(st.integers(0, 1000), st.floats(0.3, 0.7))
def test_a_stretch_that_is_offset_from_the_map_is_found_with_its_shift(
    seed: int, offset_m: float
) -> None:
    m, places, estimate = flight_in_a_room(seed, offset_m)
    best = found(m, estimate)[0]
    assert best.by_ne_m == pytest.approx((offset_m, 0.0), abs=0.11)
    middle = round(sum(OFFSET_S) / 2 / PERIOD_S)
    moved = shifted(estimate.x, m, best).poses[middle, :2]
    assert best.begin_s < PERIOD_S * middle < best.end_s
    assert moved == pytest.approx(places[middle], abs=0.15)

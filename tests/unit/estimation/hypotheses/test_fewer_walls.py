"""The final map has one wall for one surface."""

import math
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.arrays import Array, Indices
from companion.core.messages import BEARING_FRD_RAD, Beam, Pose, RangeUnit
from companion.drivers.chips.sharp import PAPER
from companion.estimation.association.pruning import Support
from companion.estimation.hypotheses.fewer_walls import with_fewer_walls
from companion.estimation.smoothing.estimate import Estimate
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.flight_record import FlightRecord
from companion.estimation.smoothing.range_noise import BEAMS, RangeUnits
from companion.estimation.smoothing.smoother import Smoother, run_to_end
from companion.estimation.smoothing.state import Measured, Unknowns, project

UNITS = RangeUnits({b: RangeUnit(PAPER, at, 0.0) for b, at in BEARING_FRD_RAD.items()})
SMOOTHER = Smoother(Models(UNITS), Support())
START = SMOOTHER.from_start(np.zeros(3))
LENGTH_M, AHEAD_M = 8.0, 1.5


def flown(seed: int, step_m: float = 0.0) -> tuple[Measured, Unknowns]:
    """Fly 8 m east along a wall 1.5 m north; its second half stands `step_m` nearer."""
    random, record, poses = Random(seed), FlightRecord(), []
    for k in range(81):
        east_m = 0.1 * k
        poses.append((0.0, east_m, 0.0))
        pose = Pose(0.2 * k, 0.0, east_m, -1.2, 0.0)
        record.advance(pose, (0.0, east_m), 0.0)
        range_m = AHEAD_M - (step_m if east_m > LENGTH_M / 2 else 0.0)
        for _ in range(4):
            reading_m = range_m + random.gauss(0, 0.04)
            record.add_hit(pose, BEAMS.index(Beam.FRONT), reading_m, ((0.0, 0.0), 0.0), None)
    return Measured.of(record, UNITS), Unknowns.at(np.array(poses), 0.0)


def solved(
    m: Measured, x: Unknowns, wall_of: Indices, lines: list[tuple[float, float]]
) -> Estimate:
    """The solution with these walls and associations, after `with_fewer_walls`."""
    east_m: Array = project(x, m).points[:, 1]
    reach_m = [np.array(range_of(east_m[wall_of == wall])) for wall in range(len(lines))]
    x.add_walls(np.array(lines), np.array(reach_m))
    solution = SMOOTHER.step(x, m, wall_of, START)
    estimate = Estimate(x, wall_of, solution)
    return run_to_end(with_fewer_walls(SMOOTHER, estimate, m, START))


def range_of(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


@given(st.integers(0, 1000), st.floats(1.0, 7.0), st.floats(-1.0, 1.0))
def test_two_pieces_of_one_surface_become_one_wall(
    seed: int, split_at_m: float, turned_deg: float
) -> None:
    m, x = flown(seed)
    wall_of = (project(x, m).points[:, 1] > split_at_m).astype(np.int64)
    fewer = solved(m, x, wall_of, [(0.0, AHEAD_M), (math.radians(turned_deg), AHEAD_M)])
    assert len(fewer.x.walls) == 1
    assert (fewer.wall_of == 0).all()
    assert fewer.x.reach_m[0] == pytest.approx([0.0, LENGTH_M], abs=0.1)
    assert fewer.x.walls[0, 1] == pytest.approx(AHEAD_M, abs=0.08)


@given(st.integers(0, 1000))
def test_a_step_of_30_cm_stays(seed: int) -> None:
    m, x = flown(seed, step_m=0.3)
    wall_of = (project(x, m).points[:, 1] > LENGTH_M / 2 + 0.05).astype(np.int64)
    fewer = solved(m, x, wall_of, [(0.0, AHEAD_M), (0.0, AHEAD_M - 0.3)])
    assert sorted(fewer.x.walls[:, 1]) == pytest.approx([AHEAD_M - 0.3, AHEAD_M], abs=0.08)


@given(st.integers(0, 1000))
def test_a_row_of_outliers_before_a_wall_is_no_wall(seed: int) -> None:
    """The row consists of the 16 nearest readings on a metre of the wall."""
    m, x = flown(seed)
    points = project(x, m).points
    on_stretch = np.flatnonzero((points[:, 1] > 3.0) & (points[:, 1] < 4.0))
    row = on_stretch[np.argsort(points[on_stretch, 0])[:16]]
    wall_of = np.zeros(len(points), dtype=np.int64)
    wall_of[row] = 1
    fewer = solved(m, x, wall_of, [(0.0, AHEAD_M), (0.0, AHEAD_M - 0.06)])
    assert fewer.x.walls[:, 1] == pytest.approx([AHEAD_M], abs=0.08)

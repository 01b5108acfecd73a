"""Tests the joint solution of several flights: shared walls, a calibration for each flight."""

import math
from copy import deepcopy
from functools import cache

import numpy as np
import pytest

from companion.core.arrays import Array
from companion.core.frames import inverse_starts
from companion.estimation.association.pruning import Support
from companion.estimation.hypotheses.one_flight import Flights
from companion.estimation.smoothing.estimate import Estimate, MarginalPrior
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.flight_record import FlightRecord, FrameColumn, HitColumn
from companion.estimation.smoothing.joint import PlacedFlight, joined, moved_to
from companion.estimation.smoothing.smoother import FINAL_GATES, Smoother
from companion.estimation.smoothing.state import (
    POSE_SIZE,
    WALL_SIZE,
    Measured,
    Unknowns,
    to_ned,
)
from tests.unit.estimation.test_association import ROOM, UNITS, Segment, fly, mapped

SMOOTHER = Smoother(Models(UNITS), Support())
PAD_SIGMA = np.array([0.05, 0.05, math.radians(3)])
PATHS = (
    [(0.0, 0.0), (1.5, -1.5), (1.5, 1.5), (0.0, 0.0)],
    [(0.0, 0.0), (-1.5, 1.5), (-1.5, -1.5), (0.0, 0.0)],
)


def flown(path: list[tuple[float, float]], seed: int, scale_error: float) -> FlightRecord:
    """A flight whose odometry reports too long or too short motions."""
    record = fly(ROOM, path, seed)
    reported = 1 / (1 + scale_error)
    record.frames[:, FrameColumn.FORWARD_M : FrameColumn.RIGHT_M + 1] *= reported
    record.hits[:, HitColumn.FORWARD_M : HitColumn.RIGHT_M + 1] *= reported
    return record


def placed(record: FlightRecord, start: Array) -> PlacedFlight:
    here = moved_to(mapped(record).x, start)
    return PlacedFlight(Measured.of(record, UNITS), here, start, PAD_SIGMA)


def solved(flights: list[PlacedFlight]) -> Estimate:
    m, x, prior = joined(SMOOTHER, flights)
    return SMOOTHER.smooth(x, m, prior, FINAL_GATES)


def test_two_flights_share_their_walls_and_keep_a_calibration_each() -> None:
    scales = 0.03, -0.02
    records = [flown(path, 7, scale) for path, scale in zip(PATHS, scales, strict=True)]
    single, joint = mapped(records[0]), solved([placed(r, np.zeros(3)) for r in records])
    assert len(joint.x.walls) == 4
    assert joint.x.odometry_scale == pytest.approx(scales, abs=0.006)
    offsets_m = sorted(joint.x.walls[:, 1])
    assert offsets_m == pytest.approx([3.0] * 4, abs=0.02)
    sigma = [[line.sigma_m for line in each.wall_lines] for each in (single, joint)]
    assert max(sigma[1]) < max(sigma[0])


def test_a_start_off_its_pad_is_corrected_by_the_walls() -> None:
    off = np.array([0.05, -0.03, math.radians(4)])
    first = placed(fly(ROOM, PATHS[0], 3), np.zeros(3))
    second = placed(fly(seen_from(off), PATHS[1], 4), np.zeros(3))
    joint = solved([first, second])
    assert len(joint.x.walls) == 4
    begin = joint.x.poses[len(first.x.poses)]
    assert begin[:2] == pytest.approx(off[:2], abs=0.02)
    assert begin[2] == pytest.approx(off[2], abs=math.radians(0.5))


def test_moving_a_flight_and_moving_it_back_changes_nothing() -> None:
    x, start = mapped(fly(ROOM, PATHS[0], 1)).x, np.array([2.0, -1.0, 0.7])
    back = moved_to(moved_to(x, start), inverse_starts(start[None])[0])
    for field in ("poses", "walls", "reach_m"):
        assert getattr(back, field) == pytest.approx(getattr(x, field), abs=1e-9)


def seen_from(start: Array) -> list[Segment]:
    """Walls of `ROOM` in the frame of a flight that began at `start` (3,)."""
    [origin] = inverse_starts(start[None])
    ends = np.array(ROOM).reshape(-1, 2)
    moved = origin[:2] + to_ned(ends, np.full(len(ends), origin[2]))
    return [((a, b), (c, d)) for a, b, c, d in moved.reshape(-1, 4).tolist()]


@cache
def three_flights() -> tuple[Measured, Unknowns, MarginalPrior, Estimate]:
    """Three flights, the starting point of their joint solution, its prior, and the solution."""
    flights = [
        placed(flown(PATHS[i % 2], seed, scale), np.zeros(3))
        for i, (seed, scale) in enumerate(((7, 0.03), (8, -0.02), (9, 0.0)))
    ]
    m, x, prior = joined(SMOOTHER, flights)
    return m, x, prior, SMOOTHER.smooth(x, m, prior, FINAL_GATES)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_one_flight_with_the_others_as_a_prior_takes_the_step_of_the_joint_solution(
    number: int,
) -> None:
    """Identity of the Schur complement: far from the solution, too."""
    m, x, prior, solution = deepcopy(three_flights())
    draw = np.random.default_rng(number)
    x.poses[:, :3] += draw.normal(0, 0.01, (len(x.poses), 3))
    x.walls += draw.normal(0, 0.01, x.walls.shape)
    joint = SMOOTHER.system(x, m, solution.wall_of, prior).solve()

    frames = m.flight == number
    one = Flights(SMOOTHER, Estimate(x, solution.wall_of, joint), m, prior).with_frames(frames)
    alone = SMOOTHER.system(one.estimate.x, one.m, one.estimate.wall_of, one.prior).solve()
    walls = len(x.walls) * WALL_SIZE
    assert alone.shared[-walls:] == pytest.approx(joint.shared[-walls:], abs=1e-6)
    assert alone.chained == pytest.approx(joint.chained[np.repeat(frames, POSE_SIZE)], abs=1e-6)

    assert one.put_into(x, one.of(x)).poses == pytest.approx(x.poses)
    assert one.prior.cost(one.estimate.x) == 0

"""Search for alternative associations, and the autopilot's heading as a reference."""

import math
from collections.abc import Callable, Generator
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.arrays import Array
from companion.core.frames import frd_to_ned
from companion.core.messages import (
    BEARING_FRD_RAD,
    Beam,
    GyroSample,
    Odometry,
    Pose,
    RangeReading,
    RangeScan,
    RangeState,
    RangeUnit,
)
from companion.drivers.chips.sharp import PAPER
from companion.estimation.association.gating import Gate
from companion.estimation.association.pruning import Support
from companion.estimation.estimator import Estimator
from companion.estimation.hypotheses.search import (
    STRETCHES_S,
    HypothesisSearch,
    contradicted,
    strained,
)
from companion.estimation.smoothing.estimate import Estimate
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.flight_record import FlightRecord
from companion.estimation.smoothing.range_noise import BEAMS, RangeUnits
from companion.estimation.smoothing.smoother import FINAL_GATES, Smoother, run_to_end
from companion.estimation.smoothing.state import Measured, Unknowns

UNITS = RangeUnits({b: RangeUnit(PAPER, at, 0.0) for b, at in BEARING_FRD_RAD.items()})
Search = Callable[[HypothesisSearch, Estimate], Generator[None, None, Estimate]]
KEYFRAMES = 151
STEP_M = 0.1
CABINET_M = 6.0, 9.0
NO_HITS_M = 0.3
"""Distance on both sides of the cabinet's ends without hits, m."""


def flight_past_a_cabinet(seed: int, *, has_hits_at_ends: bool = True) -> tuple[Measured, Array]:
    """Fly 15 m east along a wall 1.5 m north, with a cabinet before it from 6 to 9 m.

    Returns the measurements and the positions by odometry, (k, 3).
    """
    random, record = Random(seed), FlightRecord()
    front = BEAMS.index(Beam.FRONT)
    walk_m = 0.005 * math.sqrt(2)
    north_m = east_m = 0.0
    poses = []
    for k in range(KEYFRAMES):
        poses.append((north_m, east_m, 0.0))
        pose = Pose(0.2 * k, north_m, east_m, -1.2, 0.0)
        record.advance(pose, (north_m, east_m), 0.0)
        before_m = 0.5 if CABINET_M[0] < k * STEP_M < CABINET_M[1] else 0.0
        is_at_end = min(abs(k * STEP_M - end_m) for end_m in CABINET_M) < NO_HITS_M
        for _ in range(4 if has_hits_at_ends or not is_at_end else 0):
            reading_m = 1.5 - before_m + random.gauss(0, 0.05)
            record.add_hit(pose, front, reading_m, ((0.0, 0.0), 0.0), None)
        north_m += random.gauss(0, walk_m)
        east_m += STEP_M + random.gauss(0, walk_m)
    return Measured.of(record, UNITS), np.array(poses)


@given(st.integers(0, 1000))
def test_the_trajectory_of_the_odometry_is_not_contradicted(seed: int) -> None:
    m, poses = flight_past_a_cabinet(seed)
    assert not contradicted(Unknowns.at(poses, 0.0), m, Models(UNITS)).any()


@given(st.integers(0, 1000), st.floats(0.25, 1.0), st.floats(0.4, 3.0))
def test_a_stretch_shifted_sideways_is_contradicted(
    seed: int, aside_m: float, within_s: float
) -> None:
    """Shifted between the keyframes 50 and 100, with ramps at both ends."""
    m, poses = flight_past_a_cabinet(seed)
    k = np.arange(KEYFRAMES)
    ramp = np.minimum(k - 50, 100 - k) * 0.2 / within_s
    poses[:, 0] += aside_m * np.clip(ramp, 0, 1)
    suspect = contradicted(Unknowns.at(poses, 0.0), m, Models(UNITS))
    assert suspect[52:99].all()
    assert not suspect[:10].any()
    assert not suspect[-10:].any()


@pytest.mark.parametrize("length_s", STRETCHES_S)
@given(st.integers(0, 1000), st.integers(40, 110))
def test_the_stretch_that_strains_odometry_most_is_searched_first(
    length_s: float, seed: int, moved_at: int
) -> None:
    """A permanent shift of 0.3 m within 1 s."""
    m, poses = flight_past_a_cabinet(seed)
    poses[:, 0] += 0.3 * np.clip((np.arange(KEYFRAMES) - moved_at) / 5, 0, 1)
    first, *_ = strained(Unknowns.at(poses, 0.0), m, Models(UNITS).odometry, length_s)
    assert first[moved_at : moved_at + 5].all()
    assert np.ptp(m.time_s[first]) <= length_s


@given(st.integers(0, 1000))
def test_a_heading_change_by_an_implausible_gyro_bias_is_contradicted(seed: int) -> None:
    """A change of 3° within the last 15 s, as along a wall with a step mapped as one surface."""
    m, poses = flight_past_a_cabinet(seed)
    x = Unknowns.at(poses, 0.0)
    x.poses[75:, 3] = math.radians(0.4) * np.linspace(0, 1, KEYFRAMES - 75)
    suspect = contradicted(x, m, Models(UNITS))
    assert suspect[80:].all()
    assert not suspect[:50].any()


@pytest.mark.parametrize(
    "search", [HypothesisSearch.in_flight_search, HypothesisSearch.final_search]
)
def test_hits_associated_with_a_wrong_wall_get_their_own_wall(search: Search) -> None:
    """The cabinet's hits are associated with the wall, which shifts the path by half a metre.

    No beam crosses the cabinet's ends, where the step would be detected.
    """
    m, poses = flight_past_a_cabinet(1, has_hits_at_ends=False)
    k = np.arange(KEYFRAMES)
    poses[:, 0] += 0.5 * np.clip(np.minimum(k - 50, 100 - k) / 10, 0, 1)
    x = Unknowns.at(poses, 0.0)
    x.add_walls(np.array([(0.0, 1.5)]), np.array([(-1.0, 16.0)]))
    smoother = Smoother(Models(UNITS), Support())
    start = smoother.from_start(np.zeros(3))
    pulled = smoother.smooth(x, m, start, (Gate(0.2), Gate(0.1)))
    assert wall_distance_m(pulled.x).min() < 1.2
    likelier = run_to_end(search(HypothesisSearch(smoother, m, start, FINAL_GATES), pulled))
    assert wall_distance_m(likelier.x) == pytest.approx(1.5, abs=0.1)
    assert sorted(likelier.x.walls[:, 1]) == pytest.approx([1.0, 1.5], abs=0.05)


def wall_distance_m(x: Unknowns) -> Array:
    """(k,): distance of the keyframes from the wall with the largest reach."""
    longest = int(np.ptp(x.reach_m, axis=1).argmax())
    distance_m: Array = x.walls[longest, 1] - x.poses[:, :2] @ x.normals[longest]
    return distance_m


def wall_turned_deg(compass_deg: float, *, follows_us: bool = False) -> float:
    """Hover for 6 s with nothing in range, then fly 40 m east past a wall.

    Our gyro drifts by 0.2 deg/s in the hover only, so the wall would appear turned by a degree. The
    autopilot's gyro drifts by 0.1 deg/s, and a compass resets its heading. Returns the error of the
    wall's direction, deg.
    """
    estimator, random = Estimator(0.0, UNITS.units), Random(1)
    north_m = east_m = 0.0
    estimator.turn([GyroSample(0.0, 0.0)])
    for tick in range(1, 921):
        time_s = 0.05 * tick
        drift_rad_s = math.radians(0.2) if time_s < 6 else 0.0
        estimator.turn([GyroSample(time_s, drift_rad_s)])
        autopilot_rad = math.radians(0.1 * time_s + (compass_deg if time_s > 3 else 0.0))
        moved_m = frd_to_ned(0.0, 0.05 if time_s > 6 else 0.0, autopilot_rad)
        north_m, east_m = north_m + moved_m[0], east_m + moved_m[1]
        down_m = -min(time_s, 1.2)
        place = north_m, east_m, down_m
        estimator.move(Odometry(time_s, place, (0.0, 0.0, 0.0), autopilot_rad, follows_us))
        wall = RangeReading(RangeState.DISTANCE, 1.5 + random.gauss(0, 0.05), 0.0025)
        seen = wall if time_s > 6 else RangeReading(RangeState.NOTHING)
        estimator.see(RangeScan(time_s, {Beam.FRONT: seen}))
    smoothed = estimator.smoothed()
    assert smoothed is not None
    (wall_line,) = smoothed.walls
    return abs(math.degrees(wall_line.normal_rad))


@pytest.mark.parametrize("compass_deg", [0.0, 13.0, -90.0])
def test_the_autopilots_heading_corrects_a_drift_of_our_gyro(compass_deg: float) -> None:
    assert wall_turned_deg(compass_deg) < 0.6


def test_the_heading_of_an_autopilot_that_receives_our_pose_is_not_used() -> None:
    assert wall_turned_deg(0.0, follows_us=True) > 0.9

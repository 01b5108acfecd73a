"""Tests of readings beside near walls in turns: a far reading and a folded one look alike."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.frames import Vector2
from companion.core.messages import Beam, RangeReading, RangeState, WallSegment
from companion.drivers.chips.sharp import GP2Y0A710K0F, PAPER
from companion.safety.beam_track import BeamTrack
from companion.safety.drift import Drift
from companion.safety.mapped_obstacles import ends_ne_m
from tests.unit.safety.near_obstacles import Drone, at, near

OFFSET_M = 0.08
SWEEPS_PER_S = 20


def turn_beside_a_wall(
    to_wall_m: float, from_deg: float, to_deg: float, seed: int
) -> list[tuple[float, RangeReading]]:
    """True distances along the front beam, and what is made of the readings, in a turn of 60°/s.

    `to_wall_m`: from the sensor to the wall, where the beam is square to it at 0°.
    """
    drone, rng = Drone(near(GP2Y0A710K0F, OFFSET_M)), np.random.default_rng(seed)
    step_deg = math.copysign(60 / SWEEPS_PER_S, to_deg - from_deg)
    seen = []
    for heading_deg in np.arange(from_deg, to_deg, step_deg):
        heading_rad = math.radians(float(heading_deg))
        drone.turn_to(heading_rad)
        true_m = (to_wall_m + OFFSET_M) / math.cos(heading_rad) - OFFSET_M
        volts = GP2Y0A710K0F.volts(true_m) + rng.normal(0.0, GP2Y0A710K0F.noise_v)
        reading = drone.see(front=GP2Y0A710K0F.reading(volts)).readings[Beam.FRONT]
        seen.append((true_m, reading))
        drone.move(0.0)
    return seen


@given(to_wall_m=st.floats(0.45, 0.7), seed=st.integers(0, 99))
@settings(deadline=None)
def test_a_beam_that_turns_away_from_a_near_wall_measures_it(to_wall_m: float, seed: int) -> None:
    """In a corridor of 1 m such readings became obstacles in its middle, and held the drone."""
    for true_m, reading in turn_beside_a_wall(to_wall_m, -10.0, 70.0, seed):
        if true_m > 1.15:
            assert reading.distance_m == pytest.approx(true_m, abs=0.12)


@given(to_wall_m=st.floats(0.3, 0.4), seed=st.integers(0, 99))
@settings(deadline=None)
def test_a_beam_that_turns_towards_an_unknown_near_wall_does_not_read_far(
    to_wall_m: float, seed: int
) -> None:
    last_m, last = turn_beside_a_wall(to_wall_m, -50.0, 0.0, seed)[-1]
    assert last.distance_m == pytest.approx(last_m, abs=0.1)


def test_a_beam_that_does_not_turn_follows_no_wall() -> None:
    track = BeamTrack()
    for step in range(20):
        track.add(0.05 * step, (0.03 * step, 1.0), 0.0)
    assert not track.is_wall((0.3, 0.0))


@pytest.mark.parametrize(("bend_m", "is_wall"), [(0.0, True), (1.0, False)])
def test_only_a_straight_line_is_a_wall(bend_m: float, is_wall: bool) -> None:
    track = BeamTrack()
    for step, bearing_rad in enumerate(np.linspace(0.3, 1.0, 15)):
        aside_m = math.tan(float(bearing_rad)) * 0.6
        end_ne_m: Vector2 = 0.6 + bend_m * (step / 14) ** 2, aside_m
        track.add(0.05 * step, end_ne_m, float(bearing_rad))
    assert track.is_wall((0.0, 0.0)) == is_wall


def test_a_reading_behind_an_edge_close_to_the_beam_has_not_folded_back() -> None:
    """The reading lies on a measured wall; its alias only near the edge, not on it."""
    drone = Drone(near(GP2Y0A710K0F, 0.0))
    folds_at_m = GP2Y0A710K0F.alias_m(1.2)
    assert folds_at_m is not None
    drone.move(-0.8)
    drone.see(front=at(2.0))  # the wall
    edge_m = folds_at_m + 0.8 + 0.15
    drone.turn_to(-math.asin(0.1 / edge_m))
    drone.see(front=at(edge_m))
    drone.turn_to(0.0)
    drone.move(0.8)
    assert drone.see(front=at(1.2)).readings[Beam.FRONT].is_distance


def test_a_wall_of_earlier_flights_is_not_certain_at_its_ends() -> None:
    ends = ends_ne_m([WallSegment((0.0, 0.0), (2.0, 0.0), 0.01, 0, 0.001)])
    assert ends[0].tolist() == [pytest.approx([0.15, 0.0]), pytest.approx([1.85, 0.0])]
    short = ends_ne_m([WallSegment((0.0, 0.0), (0.2, 0.0), 0.01, 0, 0.001)])
    assert short[0].tolist() == [pytest.approx([0.1, 0.0]), pytest.approx([0.1, 0.0])]


def test_a_doubtful_point_beside_a_wall_is_removed_by_beams_that_end_behind_it() -> None:
    """One reading from afar held a drone for 80 s: on one side of it no beam came 0.3 m farther."""
    drone = Drone(near(PAPER, 0.0), Drift(walk_m2_per_s=0.016**2))
    drone.see(front=RangeReading(RangeState.DISTANCE, 2.2, 0.07**2))
    drone.move(1.6, in_s=20.0)
    assert len(drone.near.surroundings(0.5).points_frd_m) == 1
    for _ in range(3):
        for heading_rad in np.linspace(-0.4, 0.4, 81):
            drone.turn_to(float(heading_rad))
            drone.see(front=at(3.0 if heading_rad < 0.2 else 0.85))
            drone.move(0.0)
    drone.turn_to(0.0)
    ahead_m, aside_m = drone.near.surroundings(0.5).points_frd_m.T
    assert (np.hypot(ahead_m - 0.6, aside_m) > 0.15).all()

"""Tests of readings too near to be measured, and of readings that fold back to a false distance."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.messages import Beam, RangeReading, RangeScan, RangeState, Setpoint
from companion.drivers.chips.sharp import GP2Y0A710K0F, PAPER
from companion.safety.drift import Drift
from companion.safety.fold_back import unfolded_up
from companion.safety.velocity_guard import guarded
from tests.unit.safety.near_obstacles import CLEARANCE_M, FORWARD, Drone, at, near


@pytest.mark.parametrize("strength", ["too strong", "folded"])
def test_a_post_that_is_too_near_to_be_measured_is_detected_again(strength: str) -> None:
    """The signal reads 0.9 m or 1.5 m; odometry drifts by as much as the post is wide."""
    sensor = GP2Y0A710K0F
    drone = Drone(near(sensor, 0.08), Drift(walk_m2_per_s=0.016**2))
    drone.see(front=at(1.2))
    reads_m = 0.9 if strength == "too strong" else 1.5
    alias_m = sensor.alias_m(reads_m)
    assert alias_m is not None
    reading = RangeReading(RangeState.TOO_NEAR, 0.9) if strength == "too strong" else at(reads_m)
    drone.move(1.2 - alias_m)
    post_m = alias_m + 0.08
    for aside_m in np.linspace(0.0, 0.09, 10):
        for heading_rad in np.linspace(-0.4, 0.4, 81):
            drone.turn_to(float(heading_rad))
            is_met = abs(post_m * math.sin(heading_rad) - aside_m) < 0.03
            drone.see(front=reading if is_met else RangeReading(RangeState.NOTHING))
        drone.move(0.0, in_s=0.5)
    drone.turn_to(0.0)
    assert min(math.dist(point, (post_m, 0.09)) for point in drone.points) < 0.05


def test_a_nearer_too_near_reading_moves_the_point_of_an_earlier_one() -> None:
    """A leg at 0.5 m read 0.8 m and became a second point; the drone hit the real leg."""
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.see(front=RangeReading(RangeState.TOO_NEAR, 0.94))
    drone.move(0.48)
    for _ in range(20):
        drone.see(front=RangeReading(RangeState.TOO_NEAR, 0.8))
    [(forward_m, _)] = drone.near.surroundings(0.5).points_frd_m
    assert forward_m == pytest.approx(0.54)


def test_the_drone_retreats_from_an_unmeasurable_obstacle_as_drift_grows() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.08), Drift(walk_m2_per_s=0.016**2))
    drone.see(front=at(1.2))
    drone.move(0.7)

    def speed_m_s() -> float:
        around = drone.near.surroundings(0.5)
        return guarded(Setpoint(), around, CLEARANCE_M).forward_m_s

    assert speed_m_s() == 0
    for _ in range(2000):  # 100 s; the sensor measures nothing below a metre
        drone.move(0.0)
        drone.see(front=RangeReading(RangeState.TOO_NEAR))
    assert -0.15 <= speed_m_s() < -0.05


def test_a_measured_point_stays_while_it_is_too_near_to_be_measured() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.see(front=at(1.1))
    for _ in range(14):
        drone.move(0.05)
    for _ in range(5):
        drone.see(front=at(5.2))  # a very near obstacle may give the same reading
    assert drone.points == [pytest.approx((0.48, 0.0))]


def test_a_folded_back_reading_becomes_too_near() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.0))
    drone.see(front=at(1.1))
    for _ in range(14):
        drone.move(0.05)
    folded = GP2Y0A710K0F.reading(GP2Y0A710K0F.volts(0.4))
    assert folded.is_distance
    assert drone.see(front=folded).readings[Beam.FRONT].state is RangeState.TOO_NEAR
    assert min(forward_m for forward_m, _ in drone.points) == pytest.approx(0.4, abs=0.03)


def test_a_folded_back_reading_beside_a_wall_of_earlier_flights_becomes_too_near() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.0))
    drone.see(front=at(5.2))  # the light of another drone's sensor
    folded = GP2Y0A710K0F.reading(GP2Y0A710K0F.volts(0.4))
    seen = drone.see_beside({Beam.FRONT: 0.5}, front=folded)
    assert seen.readings[Beam.FRONT].state is RangeState.TOO_NEAR
    assert drone.see_beside({Beam.FRONT: 1.1}, front=folded).readings[Beam.FRONT].is_distance


def test_a_wall_of_earlier_flights_that_beams_pass_does_not_mark_readings() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.0))
    for _ in range(20):
        drone.see(front=at(3.0))
    assert drone.see_beside({Beam.FRONT: 0.4}, front=at(1.2)).readings[Beam.FRONT].is_distance


def test_an_inferred_point_does_not_mark_the_next_reading_as_folded_back() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.0))
    drone.see(right=at(1.1))
    folded = GP2Y0A710K0F.reading(GP2Y0A710K0F.volts(0.4))
    assert drone.see(right=folded).readings[Beam.RIGHT].is_distance
    assert drone.see(right=folded).readings[Beam.RIGHT].is_distance


def test_a_wall_that_approaches_undetected_reads_too_near_and_not_its_alias() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.0))
    for right_m in np.arange(0.6, 0.3, -0.01):  # as at a corner that the drone passes closely
        reading = GP2Y0A710K0F.reading(GP2Y0A710K0F.volts(right_m))
        seen = drone.see(right=reading).readings[Beam.RIGHT]
        assert seen.state is RangeState.TOO_NEAR
        drone.move(0.03)


def beside_a_wall(metres: list[float]) -> list[RangeReading]:
    """The readings of a wall at these distances to the right, after the memory's check."""
    drone, rng = Drone(near(GP2Y0A710K0F, 0.0)), np.random.default_rng(1)
    seen = []
    for right_m in metres:
        volts = GP2Y0A710K0F.volts(right_m) + rng.normal(0.0, GP2Y0A710K0F.noise_v)
        seen.append(drone.see(right=GP2Y0A710K0F.reading(volts)).readings[Beam.RIGHT])
        drone.move(0.03)
    return seen


@pytest.mark.parametrize("slope", [0.1, 0.2, 0.35])
def test_readings_of_a_wall_that_recedes_obliquely_are_valid(slope: float) -> None:
    metres = [0.7 + 0.03 * slope * i for i in range(round(0.7 / (0.03 * slope)))]
    for right_m, reading in zip(metres, beside_a_wall(metres), strict=True):
        if right_m > 1.05:
            assert reading.distance_m == pytest.approx(right_m, abs=0.1)


@pytest.mark.parametrize("behind_m", [1.2, 1.6, 2.5])
def test_readings_behind_the_end_of_a_near_wall_are_valid(behind_m: float) -> None:
    metres = [0.6] * 20 + [behind_m] * 20
    last = beside_a_wall(metres)[-1]
    assert last.distance_m == pytest.approx(behind_m, abs=0.15)


def test_readings_beside_an_edge_do_not_mark_far_readings_as_folded_back() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    for degree, between_m in enumerate(np.geomspace(0.5, 4.0, 30)):  # of a wide beam at an edge
        drone.turn_to(math.radians(degree))
        drone.see(front=GP2Y0A710K0F.reading(GP2Y0A710K0F.volts(float(between_m))))
    for _ in range(30):
        drone.move(-0.005)
        last = drone.see(front=at(4.0))
    assert last.readings[Beam.FRONT].is_distance


@pytest.mark.parametrize("guess_m", [0.25, 0.55])
def test_an_estimate_of_a_too_near_distance_does_not_move_a_measured_point(guess_m: float) -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.0))
    drone.see(front=at(1.1))
    for _ in range(14):
        drone.move(0.05)
    drone.see(front=RangeReading(RangeState.TOO_NEAR, guess_m))
    assert drone.points == [pytest.approx((0.4, 0.0))]


def test_readings_of_a_sensor_without_aliasing_are_valid() -> None:
    drone = Drone(near(PAPER, 0.0))
    drone.see(front=at(0.4))
    assert drone.see(front=at(1.1)).readings[Beam.FRONT].is_distance


def test_a_too_near_point_stays_while_readings_may_be_folded_back() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.see(front=RangeReading(RangeState.TOO_NEAR))
    for _ in range(5):
        drone.see(front=at(1.6))
    assert len(drone.points) == 2
    drone.sweep(front=RangeReading(RangeState.NOTHING))
    assert drone.points == []


@pytest.mark.parametrize("was", [RangeReading(RangeState.TOO_NEAR), at(1.2)])
def test_a_moved_obstacle_is_removed_where_a_folded_back_reading_would_be_nearer(
    was: RangeReading,
) -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.see(front=was)
    drone.move(max(forward_m for forward_m, _ in drone.points) - 0.75)
    drone.sweep(front=at(3.0))  # 3.0 m and 0.22 m from the sensor give the same reading
    assert drone.points == []


def test_the_drone_slows_down_at_a_sudden_too_near_reading() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.see(front=RangeReading(RangeState.TOO_NEAR))
    stopped = guarded(FORWARD, drone.near.surroundings(0.5), CLEARANCE_M)
    assert stopped.forward_m_s < 0.2


@given(reads_m=st.floats(1.5, 4.0), error_m=st.floats(-0.1, 0.1), above_m=st.floats(1.2, 5.0))
def test_a_folded_reading_of_the_known_ceiling_is_too_near(
    reads_m: float, error_m: float, above_m: float
) -> None:
    """A drone near the ceiling read 1.7 m above it, and climbed."""
    scan = RangeScan(0.0, {Beam.UP: at(reads_m)})
    alias_m = GP2Y0A710K0F.alias_m(reads_m)
    assert alias_m is not None
    near_ceiling = unfolded_up(scan, GP2Y0A710K0F, alias_m + error_m).readings[Beam.UP]
    assert near_ceiling.state is RangeState.TOO_NEAR
    assert near_ceiling.distance_m == alias_m
    assert unfolded_up(scan, GP2Y0A710K0F, above_m) is scan
    assert unfolded_up(scan, GP2Y0A710K0F, math.inf) is scan  # the ceiling is not known

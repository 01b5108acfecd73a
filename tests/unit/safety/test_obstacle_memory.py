"""Tests that stored obstacles keep their place, and that later readings correct or remove them."""

import math
from itertools import pairwise

import numpy as np
import pytest

from companion.core.messages import RangeReading, RangeState
from companion.drivers.chips.sharp import GP2Y0A710K0F
from companion.safety.drift import Drift
from companion.safety.obstacle_points import KEPT_S
from companion.safety.velocity_guard import guarded
from tests.unit.safety.near_obstacles import CLEARANCE_M, FORWARD, Drone, at, near


def test_an_obstacle_point_keeps_its_place_while_the_drone_moves() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.see(right=at(1.2))
    drone.move(0.3)
    [(forward_m, right_m)] = drone.points
    assert forward_m == pytest.approx(-0.3)
    assert right_m == pytest.approx(1.28)


def test_the_point_of_a_moved_obstacle_is_removed() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.see(front=at(1.2))
    drone.sweep(front=at(3.5))
    assert drone.points == []


def test_beams_that_pass_beside_a_thin_pole_do_not_remove_it() -> None:
    """The pole is 5 cm wide, and stands 3 cm beside its stored position."""
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.see(front=at(1.2))
    drone.sweep_beside(0.005, 0.055)
    assert drone.points == [pytest.approx((1.28, 0.0))]


@pytest.mark.parametrize("aside_m", [0.0, 0.005, 0.01, 0.015, 0.03])
def test_beams_that_pass_a_leg_on_either_side_do_not_remove_it(aside_m: float) -> None:
    """The leg is 3 cm wide, and stands a little beside its stored position."""
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.see(front=at(1.2))
    drone.sweep_beside(aside_m - 0.015, aside_m + 0.015)
    assert drone.points == [pytest.approx((1.28, 0.0))]


def test_beams_beside_a_pole_do_not_remove_it_after_drift_of_more_than_its_width() -> None:
    """The pole stands 9 cm beside its stored position."""
    drone = Drone(near(GP2Y0A710K0F, 0.08), Drift(walk_m2_per_s=0.016**2))
    drone.see(front=at(1.2))
    drone.move(0.0, in_s=20.0)
    drone.sweep_beside(0.065, 0.115)
    assert drone.points == [pytest.approx((1.28, 0.0))]


def test_beams_on_either_side_of_a_post_do_not_remove_it_during_drift() -> None:
    """The post is 5 cm right of its stored position, and half a minute later 5 cm left."""
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.see(front=at(1.2))
    for aside_m in (0.05, -0.05):
        for heading_rad in np.linspace(-0.15, 0.15, 61):
            if abs(1.28 * heading_rad - aside_m) > 0.04:
                drone.turn_to(float(heading_rad))
                drone.see(front=at(3.5))
        drone.move(0.0, in_s=30.0)
    drone.turn_to(0.0)
    assert drone.points == [pytest.approx((1.28, 0.0))]


def test_clearance_from_a_far_detection_includes_its_sigma_until_an_exact_detection() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.see(front=at(3.4))
    drone.move(2.2)
    far = guarded(FORWARD, drone.all_swept, CLEARANCE_M).forward_m_s
    drone.see(front=at(1.2))
    exact = guarded(FORWARD, drone.all_swept, CLEARANCE_M).forward_m_s
    assert 0 < far < exact < FORWARD.forward_m_s
    assert len(drone.near.surroundings(0.5).points_frd_m) == 1


def test_a_vague_point_is_moved_out_of_swept_space() -> None:
    """A jamb detected from far away would block the middle of its doorway."""
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.turn_to(math.radians(30))
    drone.see(front=RangeReading(RangeState.DISTANCE, 3.0, 0.15**2))
    drone.turn_to(0.0)
    drone.move(2.3)

    def aside_m() -> float:
        [(_, right_m)] = drone.near.surroundings(0.5).points_frd_m
        return float(right_m)

    assert 1.38 < aside_m() < 1.41
    for _ in range(12):
        drone.see(right=RangeReading(RangeState.NOTHING))
        drone.move(0.025)
    assert 1.48 < aside_m() < 1.54


def test_a_vague_reading_does_not_move_an_exact_point() -> None:
    """A jamb that read 20 cm too near from 4 m blocked its own doorway for a minute."""
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.see(front=at(1.6))
    drone.move(-2.4)
    for _ in range(200):
        drone.see(right=RangeReading(RangeState.NOTHING))
    drone.see(front=RangeReading(RangeState.DISTANCE, 3.8, 0.12**2))
    [(forward_m, _)] = drone.near.surroundings(0.5).points_frd_m
    assert forward_m == pytest.approx(4.08)


@pytest.mark.parametrize("sigmas_short", [0.5, 2.6])
def test_a_later_exact_reading_replaces_a_vague_point(sigmas_short: float) -> None:
    """A jamb that read 2.6 sigmas too near left a point that blocked the doorway home."""
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    sigma_m = 0.07
    drone.see(front=RangeReading(RangeState.DISTANCE, 3.0 - sigmas_short * sigma_m, sigma_m**2))
    drone.move(1.4)
    drone.see(front=at(1.6))
    [(forward_m, _)] = drone.near.surroundings(0.5).points_frd_m
    assert forward_m == pytest.approx(1.68)


def test_a_point_that_is_detected_repeatedly_does_not_expire() -> None:
    """The drone hovered before a leg for two minutes; the point expired, and the drone hit it."""
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    drone.see(front=at(1.2))
    drone.move(0.6)
    for _ in range(int(2 * KEPT_S)):
        drone.move(0.0, in_s=1.0)
        drone.see(front=RangeReading(RangeState.TOO_NEAR))
    [(forward_m, _)] = drone.near.surroundings(0.5).points_frd_m
    assert forward_m == pytest.approx(0.68)


def test_a_beam_beside_the_edge_of_a_jamb_does_not_remove_the_jamb() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    for _ in range(5):
        drone.see(right=at(1.2))
        drone.move(0.05)
    for _ in range(8):
        drone.see(right=at(3.5))
        drone.move(0.002)
    assert len(drone.points) == 5


def test_a_new_detection_of_a_jamb_removes_points_that_drifted_into_the_doorway() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    for _ in range(5):
        drone.see(right=at(1.2))
        drone.move(0.05)
    drone.move(-0.45, in_s=60.0)
    for _ in range(8):  # the jamb ends 0.2 m sooner than by odometry
        drone.see(right=at(1.2))
        drone.move(0.025)
    for _ in range(30):
        drone.see(right=at(3.5))
        drone.move(0.01)
    ahead_m = max(forward_m for forward_m, _ in drone.points)
    assert ahead_m == pytest.approx(-0.3 - 0.025, abs=0.03)


@pytest.mark.parametrize(("nearer_m", "in_s", "is_one"), [(0.15, 60, True), (0.15, 1, False)])
def test_a_detection_within_the_drift_of_an_old_point_replaces_the_point(
    nearer_m: float, in_s: float, is_one: bool
) -> None:
    """A jamb stored twice, 0.2 m apart, led the drone into the other jamb."""
    drone = Drone(near(GP2Y0A710K0F, 0.08), Drift(walk_m2_per_s=0.01**2))
    drone.see(right=at(1.2))
    drone.move(0.0, in_s=in_s)
    drone.see(right=at(1.2 - nearer_m))
    assert len(drone.points) == (1 if is_one else 2)
    assert min(right_m for _, right_m in drone.points) == pytest.approx(1.28 - nearer_m)


def test_a_slowly_moving_beam_stores_points_along_all_of_a_surface() -> None:
    drone = Drone(near(GP2Y0A710K0F, 0.08))
    for _ in range(30):
        drone.see(right=at(1.2))
        drone.move(0.01)
    along_m = sorted(forward_m for forward_m, _ in drone.points)
    assert along_m[-1] - along_m[0] > 0.25
    assert max(b - a for a, b in pairwise(along_m)) < 0.06

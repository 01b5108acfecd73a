"""Recent obstacles are stored, and the limited velocity keeps the clearance from them."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.messages import (
    BEARING_FRD_RAD,
    Beam,
    RangeModel,
    RangeReading,
    RangeScan,
    RangeState,
    RangeUnit,
    Setpoint,
)
from companion.drivers.chips.sharp import GP2Y0A710K0F, PAPER
from companion.safety.obstacle_memory import ObstacleMemory, Surroundings
from companion.safety.obstacle_points import KEPT_S, NO_DRIFT, Drift
from companion.safety.swept_space import all_swept
from companion.safety.velocity_guard import guarded

CLEARANCE_M = 0.3
KEEP_OFF_M = 0.5
FORWARD = Setpoint(forward_m_s=1.0, yaw_rate_rad_s=0.3)
Place = tuple[float, float]


def near(sensor: RangeModel, offset_m: float) -> ObstacleMemory:
    """Obstacle memory of four such sensors, at `offset_m` from the drone's centre."""
    return ObstacleMemory(
        {beam: RangeUnit(sensor, at, offset_m) for beam, at in BEARING_FRD_RAD.items()}
    )


def wall(ahead_m: float, half_m: float = 1.0) -> list[Place]:
    """Points of a wall perpendicular to the nose."""
    return [(ahead_m, 0.05 * i) for i in range(-round(20 * half_m), round(20 * half_m) + 1)]


def doorway(width_m: float, ahead_m: float = 0.0, aside_m: float = 0.0) -> list[Place]:
    """Points of a doorway: two jambs and the wall on either side."""
    half_m = width_m / 2
    right = [(ahead_m, aside_m + half_m + 0.05 * i) for i in range(20)]
    left = [(ahead_m, aside_m - half_m - 0.05 * i) for i in range(20)]
    return right + left


def around(points: list[Place], speed: Place = (0.0, 0.0)) -> Surroundings:
    return Surroundings(np.array(points), speed)


def test_without_near_obstacles_the_setpoint_is_unchanged() -> None:
    assert guarded(FORWARD, Surroundings(), CLEARANCE_M) == FORWARD


def test_the_drone_slows_down_before_a_wall_and_stops_short_of_it() -> None:
    speeds = [
        guarded(FORWARD, around(wall(ahead_m)), CLEARANCE_M).forward_m_s
        for ahead_m in (3.0, 1.0, 0.7, KEEP_OFF_M)
    ]
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[0] == 1.0
    assert speeds[-1] <= 0


def test_a_faster_drone_slows_down_earlier() -> None:
    slow = guarded(FORWARD, around(wall(1.0), (0.1, 0.0)), CLEARANCE_M)
    fast = guarded(FORWARD, around(wall(1.0), (1.0, 0.0)), CLEARANCE_M)
    assert fast.forward_m_s < slow.forward_m_s


def test_the_yaw_rate_is_not_limited() -> None:
    assert guarded(FORWARD, around(wall(0.5)), CLEARANCE_M).yaw_rate_rad_s == 0.3


def test_the_drone_retreats_from_an_obstacle_that_is_too_near() -> None:
    assert guarded(Setpoint(), around(wall(0.4)), CLEARANCE_M).forward_m_s < 0


def test_the_drone_continues_along_a_wall() -> None:
    beside = [(along_m, 0.55) for along_m in np.linspace(-1, 1, 41)]
    speed = guarded(FORWARD, around(beside), CLEARANCE_M)
    assert speed.forward_m_s > 0.3
    assert -0.2 < speed.right_m_s <= 0


@pytest.mark.parametrize("width_m", [0.9, 1.0, 1.4])
def test_the_drone_passes_a_doorway_in_the_middle(width_m: float) -> None:
    assert guarded(FORWARD, around(doorway(width_m)), CLEARANCE_M).forward_m_s > 0.2
    before = guarded(FORWARD, around(doorway(width_m, ahead_m=0.3)), CLEARANCE_M)
    assert before.forward_m_s > 0.05


def test_the_drone_does_not_enter_a_doorway_that_is_too_narrow() -> None:
    for ahead_m in (0.2, 0.1):
        narrow = around(doorway(0.6, ahead_m))
        assert guarded(FORWARD, narrow, CLEARANCE_M).forward_m_s <= 0


def test_the_drone_moves_towards_the_middle_of_a_doorway() -> None:
    to_the_right = guarded(FORWARD, around(doorway(1.0, aside_m=0.1)), CLEARANCE_M)
    assert to_the_right.right_m_s > 0


@pytest.mark.parametrize("aside_m", [-0.06, 0.06])
def test_the_drone_keeps_to_the_middle_between_two_near_obstacles(aside_m: float) -> None:
    for setpoint in (Setpoint(), FORWARD):
        safe = guarded(setpoint, around(doorway(0.6, aside_m=aside_m)), CLEARANCE_M)
        assert safe.right_m_s * aside_m > 0
        assert abs(safe.right_m_s) > 0.02


@pytest.mark.parametrize("width_m", [0.9, 1.0, 1.2])
@pytest.mark.parametrize("askew_deg", [0, 20, 40, 60])
def test_the_drone_continues_along_a_corridor_at_an_oblique_heading(
    width_m: float, askew_deg: float
) -> None:
    along = np.array([math.cos(math.radians(askew_deg)), -math.sin(math.radians(askew_deg))])
    across = np.array([-along[1], along[0]])
    steps = [0.05 * i for i in range(-30, 31)]
    walls = [i * along + side * width_m / 2 * across for i in steps for side in (-1, 1)]
    safe = guarded(FORWARD, Surroundings(np.array(walls)), CLEARANCE_M)
    velocity = np.array([safe.forward_m_s, safe.right_m_s])
    assert velocity @ along > 0.3
    assert abs(velocity @ across) < 0.35


def test_the_drone_keeps_its_clearance_at_the_end_of_a_corridor() -> None:
    sides = [(0.05 * i, side * 0.45) for i in range(-30, 10) for side in (-1, 1)]
    end = [(KEEP_OFF_M, 0.05 * i) for i in range(-9, 10)]
    assert guarded(FORWARD, around(sides + end), CLEARANCE_M).forward_m_s <= 0


@given(
    st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), min_size=1, max_size=20),
    st.floats(-1, 1),
    st.floats(-1, 1),
)
def test_no_velocity_leads_towards_an_obstacle_within_35_centimetres(
    points: list[Place], forward_m_s: float, right_m_s: float
) -> None:
    safe = guarded(Setpoint(forward_m_s, right_m_s), around(points), CLEARANCE_M)
    for forward_m, right_m in points:
        away_m = math.hypot(forward_m, right_m)
        if 0.01 < away_m < 0.35:
            towards = (safe.forward_m_s * forward_m + safe.right_m_s * right_m) / away_m
            assert towards <= 0.03


# Obstacle memory


def scan(time_s: float, **readings: RangeReading) -> RangeScan:
    return RangeScan(time_s, {Beam(name): reading for name, reading in readings.items()})


def at(distance_m: float) -> RangeReading:
    return RangeReading(RangeState.DISTANCE, distance_m, 0.02**2)


class Drone:
    """A drone that moves along its nose, at first to the north, and measures."""

    def __init__(self, near: ObstacleMemory, drift: Drift = NO_DRIFT) -> None:
        self.near, self._drift = near, drift
        self._north_m = self._east_m = self._heading_rad = self._time_s = 0.0
        self.move(0.0)

    def move(self, forward_m: float, in_s: float = 0.05) -> None:
        self._time_s += in_s
        self._north_m += forward_m * math.cos(self._heading_rad)
        self._east_m += forward_m * math.sin(self._heading_rad)
        self.near.move_to((self._north_m, self._east_m), drift=self._drift)

    def turn_to(self, heading_rad: float) -> None:
        self._heading_rad = heading_rad
        self.near.turn_to(heading_rad)

    def see(self, **readings: RangeReading) -> RangeScan:
        return self.near.see(scan(self._time_s, **readings))

    def sweep(self, **readings: RangeReading) -> None:
        """Sweep the beams over ±0.15 rad and return to the course."""
        for heading_rad in (*np.linspace(-0.15, 0.15, 61), 0.0):
            self.turn_to(float(heading_rad))
            self.see(**readings)

    def sweep_beside(self, from_m: float, to_m: float) -> None:
        """Sweep the front beam ten times beside a pole at 1.28 m that lies between two offsets."""
        for _ in range(10):
            for heading_rad in np.linspace(-0.15, 0.15, 61):
                if not from_m < 1.28 * heading_rad < to_m:
                    self.turn_to(float(heading_rad))
                    self.see(front=at(3.5))
        self.turn_to(0.0)

    @property
    def all_swept(self) -> Surroundings:
        """The surroundings, with all space swept."""
        return replace(self.near.surroundings(0.5), lane=all_swept)

    @property
    def points(self) -> list[Place]:
        """The points that are not vague."""
        around = self.near.surroundings(0.5)
        exact = around.points_frd_m[~around.is_vague]
        return [(float(f), float(r)) for f, r in exact]


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

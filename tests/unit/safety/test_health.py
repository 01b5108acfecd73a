"""The health checks drop invalid inputs and report faults."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.arrays import Array
from companion.core.messages import (
    BEARING_FRD_RAD,
    Beam,
    GyroSample,
    Odometry,
    RangeReading,
    RangeScan,
    RangeState,
)
from companion.safety.health.gyro import GyroWatch
from companion.safety.health.mounting import MountingWatch, misplaced
from companion.safety.health.odometry import SteadyOdometry
from companion.safety.health.ranges import RangeWatch

TICK_S = 0.05
STILL = Odometry(0.0, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), 0.0)


def flown(ticks: int, north_m_s: float = 1.0, yaw_rad_s: float = 0.0) -> list[Odometry]:
    """Odometry of a straight flight north."""
    return [
        Odometry(
            i * TICK_S,
            (north_m_s * i * TICK_S, 0.0, -1.0),
            (north_m_s, 0.0, 0.0),
            yaw_rad_s * i * TICK_S,
        )
        for i in range(ticks)
    ]


def test_odometry_without_jumps_is_unchanged() -> None:
    steady = SteadyOdometry()
    for odometry in flown(20):
        assert steady.take(odometry) is odometry


def test_a_jump_is_removed_and_motion_continues_from_before_it() -> None:
    steady = SteadyOdometry()
    for odometry in flown(20):
        x, y, z = odometry.position_ned_m
        jumped = odometry.time_s > 0.5
        moved = (
            replace(odometry, position_ned_m=(x + 2.0, y - 1.0, z - 0.5)) if jumped else odometry
        )
        given = steady.take(moved)
    assert given is not None
    north_m, east_m, down_m = given.position_ned_m
    assert north_m == pytest.approx(19 * TICK_S, abs=0.06)
    assert (east_m, down_m) == pytest.approx((0.0, -1.0))


def test_a_heading_jump_does_not_turn_the_frame() -> None:
    steady = SteadyOdometry()
    for odometry in flown(20):
        turned = replace(  # the autopilot's north is the former west
            odometry,
            position_ned_m=(0.0, odometry.position_ned_m[0], -1.0),
            velocity_ned_m_s=(0.0, 1.0, 0.0),
            yaw_rad=math.pi / 2,
        )
        given = steady.take(turned if odometry.time_s > 0.5 else odometry)
    assert given is not None
    assert given.yaw_rad == pytest.approx(0.0)
    assert given.position_ned_m[0] == pytest.approx(19 * TICK_S, abs=0.06)
    assert given.velocity_ned_m_s == pytest.approx((1.0, 0.0, 0.0))


@pytest.mark.parametrize(
    "odometry",
    [
        replace(STILL, position_ned_m=(math.nan, 0.0, 0.0)),
        replace(STILL, yaw_rad=math.inf),
        replace(STILL, velocity_ned_m_s=(math.nan, 0.0, 0.0)),
        replace(STILL, velocity_ned_m_s=(80.0, 0.0, 0.0)),
    ],
)
def test_implausible_odometry_is_dropped(odometry: Odometry) -> None:
    assert SteadyOdometry().take(odometry) is None


def samples(now_s: float, rate_rad_s: float) -> list[GyroSample]:
    return [GyroSample(now_s - TICK_S + 0.01 * i, rate_rad_s) for i in range(1, 6)]


def watched(gyro_rad_s: float, autopilot_rad_s: float, seconds: float = 5.0) -> GyroWatch:
    watch = GyroWatch()
    for odometry in flown(round(seconds / TICK_S), yaw_rad_s=autopilot_rad_s):
        watch.take(odometry.time_s, samples(odometry.time_s, gyro_rad_s), odometry, 0.0)
    return watch


def test_a_gyro_that_agrees_with_the_autopilot_has_no_fault() -> None:
    assert watched(0.8, 0.78).complaint == ""


@pytest.mark.parametrize(
    ("gyro_deg_s", "autopilot_deg_s"), [(5.0, 0.0), (0.0, 45.0), (0.0, 90.0), (45.0, 0.0)]
)
def test_a_gyro_that_disagrees_with_the_autopilot_has_a_fault(
    gyro_deg_s: float, autopilot_deg_s: float
) -> None:
    watch = watched(math.radians(gyro_deg_s), math.radians(autopilot_deg_s))
    assert watch.complaint == "gyro and autopilot do not turn alike"


def test_a_heading_reset_of_the_autopilot_is_no_gyro_fault() -> None:
    watch = watched(0.0, 0.0, seconds=1.0)
    watch.take(1.0, samples(1.0, 0.0), replace(STILL, time_s=1.0, yaw_rad=0.4), 0.0)
    assert watch.complaint == ""


def test_a_gyro_at_full_scale_is_reported_as_saturated() -> None:
    assert watched(4.27, 4.27, seconds=0.2).complaint == "the gyro is saturated"


def test_the_autopilots_turn_fills_a_gap_of_the_gyro() -> None:
    watch = watched(0.0, 0.0, seconds=1.0)
    turned = replace(STILL, time_s=3.0, yaw_rad=1.0)
    waiting = watch.take(2.9, samples(2.9, 0.0), None, 0.01)
    assert not waiting  # until the autopilot has reported its turn
    last_s, turned_rad = 19 * TICK_S, 0.0
    for sample in watch.take(3.0, samples(3.0, 0.0), turned, 0.01):
        turned_rad += (sample.yaw_rate_rad_s - 0.01) * (sample.time_s - last_s)
        last_s = sample.time_s
    assert turned_rad == pytest.approx(1.0)


def seen_by(watch: RangeWatch, odometry: Odometry, front: RangeReading) -> RangeState:
    scan = RangeScan(odometry.time_s, {Beam.FRONT: front})
    return watch.take(scan, odometry, 0.0).readings[Beam.FRONT].state


STUCK = RangeReading(RangeState.DISTANCE, 3.0, 0.01)
OPEN = RangeReading(RangeState.NOTHING, raw=1.25)


@pytest.mark.parametrize("reading", [STUCK, OPEN])
def test_a_constant_reading_in_motion_is_failed(reading: RangeReading) -> None:
    watch = RangeWatch()
    states = [seen_by(watch, odometry, reading) for odometry in flown(20)]
    assert states[5] is reading.state
    assert states[-1] is RangeState.FAILED


def test_a_constant_reading_at_rest_is_valid() -> None:
    watch = RangeWatch()
    assert {seen_by(watch, odometry, STUCK) for odometry in flown(60, 0.0)} == {RangeState.DISTANCE}


def test_nothing_in_range_in_motion_is_valid() -> None:
    watch, nothing = RangeWatch(), RangeReading(RangeState.NOTHING)
    assert {seen_by(watch, odometry, nothing) for odometry in flown(60)} == {RangeState.NOTHING}


SIGMA_M = 0.05


def shaken(sigmas: float, seed: int, metres: Sequence[float]) -> list[RangeReading]:
    """Readings of the distances, with noise of `sigmas` standard deviations."""
    noise_m = np.random.default_rng(seed).normal(0.0, sigmas * SIGMA_M, len(metres))
    metres_m = (np.array(metres) + noise_m).tolist()
    return [RangeReading(RangeState.DISTANCE, m, SIGMA_M**2) for m in metres_m]


def states_of(flight: Sequence[Odometry], readings: Sequence[RangeReading]) -> list[RangeState]:
    """States of a front beam's readings; the gyro turns as the autopilot does."""
    watch, states = RangeWatch(), []
    for odometry, reading in zip(flight, readings, strict=True):
        scan = watch.take(
            RangeScan(odometry.time_s, {Beam.FRONT: reading}), odometry, odometry.yaw_rad
        )
        states.append(scan.readings[Beam.FRONT].state)
    return states


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("north_m_s", "yaw_deg_s"), [(0.5, 0.0), (-0.5, 0.0), (0.0, 45.0)])
def test_a_distance_that_does_not_follow_the_motion_is_failed(
    seed: int, north_m_s: float, yaw_deg_s: float
) -> None:
    """The reading of an open input has less noise than that of a sensor."""
    flight = flown(60, north_m_s, math.radians(yaw_deg_s))
    assert states_of(flight, shaken(0.3, seed, [3.0] * 60))[-1] is RangeState.FAILED


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("sigmas", [0.05, 0.3, 1.0])
def test_a_low_noise_sensor_that_approaches_turns_or_rests_is_valid(
    seed: int, sigmas: float
) -> None:
    flight = flown(60, 0.5)
    comes = [4.0 - 0.5 * odometry.time_s for odometry in flight]
    assert set(states_of(flight, shaken(sigmas, seed, comes))) == {RangeState.DISTANCE}
    flight = flown(60, 0.0, math.radians(30))
    turns = [2.0 / math.cos(odometry.yaw_rad - math.radians(45)) for odometry in flight]
    assert set(states_of(flight, shaken(sigmas, seed, turns))) == {RangeState.DISTANCE}
    waits = shaken(sigmas, seed, [3.0] * 60)
    assert set(states_of(flown(60, 0.0), waits)) == {RangeState.DISTANCE}


@pytest.mark.parametrize("seed", range(5))
def test_a_constant_distance_along_a_round_wall_is_valid(seed: int) -> None:
    flight = flown(200, 0.5, -0.5)  # on a circle of one metre radius
    readings = shaken(0.3, seed, [1.5] * 200)
    watch, states = RangeWatch(), set()
    for odometry, reading in zip(flight, readings, strict=True):
        forward = replace(
            odometry,
            velocity_ned_m_s=(
                0.5 * math.cos(odometry.yaw_rad),
                0.5 * math.sin(odometry.yaw_rad),
                0.0,
            ),
        )
        scan = RangeScan(odometry.time_s, {Beam.LEFT: reading})
        states.add(watch.take(scan, forward, odometry.yaw_rad).readings[Beam.LEFT].state)
    assert states == {RangeState.DISTANCE}


def states_at(metres: Array) -> set[RangeState]:
    watch = RangeWatch()
    readings = [RangeReading(RangeState.DISTANCE, m, SIGMA_M**2) for m in metres.tolist()]
    flights = zip(flown(len(readings)), readings, strict=True)
    return {seen_by(watch, odometry, reading) for odometry, reading in flights}


@pytest.mark.parametrize("seed", range(20))
def test_a_sensor_with_ten_times_its_noise_is_failed(seed: int) -> None:
    noise_m = np.random.default_rng(seed).normal(0.0, 10 * SIGMA_M, 100)
    assert RangeState.FAILED in states_at(3.0 + noise_m)


@pytest.mark.parametrize("seed", range(20))
def test_a_beam_along_an_edge_is_valid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    walls_m = rng.choice([2.0, 3.0], 200)
    assert states_at(rng.normal(walls_m, SIGMA_M)) == {RangeState.DISTANCE}


@pytest.mark.parametrize("seed", range(20))
def test_a_beam_that_swings_over_legs_and_gaps_is_valid(seed: int) -> None:
    """Every third reading is of a leg in front of the wall; the nose swings at 40 deg/s."""
    rng = np.random.default_rng(seed)
    legs_m = np.where(rng.random(400) < 1 / 3, rng.uniform(1.2, 2.8, 400), 3.0)
    swing = [
        Odometry(i * TICK_S, (0.0, 0.0, -1.2), (0.0, 0.0, 0.0), 0.4 * math.sin(1.7 * i * TICK_S))
        for i in range(400)
    ]
    assert set(states_of(swing, shaken(1.0, seed, legs_m.tolist()))) == {RangeState.DISTANCE}


@pytest.mark.parametrize("seed", range(20))
def test_a_beam_that_meets_the_floor_before_take_off_is_valid(seed: int) -> None:
    on_ground = [Odometry(i * TICK_S, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0) for i in range(100)]
    floor = shaken(10.0, seed, [3.0] * 100)
    assert set(states_of(on_ground, floor)) == {RangeState.DISTANCE}


def profile(quarters: int) -> dict[int, float]:
    """Distances in a room with four unequal walls, for a beam `quarters` clockwise of the nose."""
    walls_m = (1.0, 2.0, 3.0, 4.0)
    return {heading: walls_m[(heading // 9 + quarters) % 4] for heading in range(36)}


def test_correctly_mounted_beams_are_not_misplaced() -> None:
    seen = {Beam.FRONT: profile(0), Beam.RIGHT: profile(1), Beam.LEFT: profile(3)}
    assert misplaced(seen) == ()


def test_swapped_beams_are_detected_in_one_turn() -> None:
    seen = {Beam.FRONT: profile(0), Beam.RIGHT: profile(3), Beam.LEFT: profile(1)}
    assert misplaced(seen) == (Beam.RIGHT, Beam.LEFT)


def turn_round(watch: MountingWatch, turns: int, quarters: dict[Beam, int]) -> None:
    """Turn on the spot; each beam measures that room from its given quarter turn."""
    for i in range(36 * turns):
        readings = {
            beam: RangeReading(RangeState.DISTANCE, profile(off)[i % 36], 0.02**2)
            for beam, off in quarters.items()
        }
        turned_rad = math.radians(10 * i)
        watch.take(RangeScan(0.1 * i, readings), (0.0, 0.0), (0.0, 0.0, 0.0, turned_rad))


@pytest.mark.parametrize(
    ("first", "is_confirmed"), [({}, False), ({Beam.RIGHT: 1, Beam.LEFT: 3}, True)]
)
def test_a_beam_that_was_confirmed_in_one_turn_stays_confirmed(
    first: dict[Beam, int], is_confirmed: bool
) -> None:
    """In a later corner of a maze, the same beam may fit another direction better."""
    watch = MountingWatch()
    if first:
        turn_round(watch, 2, {Beam.FRONT: 0, **first})
    turn_round(watch, 2, {Beam.FRONT: 0, Beam.RIGHT: 3, Beam.LEFT: 1})
    assert (watch.misplaced == ()) is is_confirmed


def watched_front(walls_m: Sequence[tuple[float, float]]) -> tuple[Beam, ...]:
    """Misplaced beams of a drone that moves along a wall in steps of a tenth of a metre.

    Each step has the front beam's range, m, and the angle of the nose off the course, deg.
    """
    watch, forward_m, right_m = MountingWatch(), 0.0, 0.0
    for i, (range_m, turned_deg) in enumerate(walls_m):
        front = RangeReading(RangeState.DISTANCE, range_m, 0.02**2)
        scan = RangeScan(0.1 * i, {Beam.FRONT: front})
        turned_rad = math.radians(turned_deg)
        forward_m += 0.1 * math.cos(turned_rad)
        right_m -= 0.1 * math.sin(turned_rad)
        watch.take(scan, (0.1 * i, 0.0), (forward_m, right_m, 0.0, turned_rad))
    return watch.misplaced


def test_a_front_beam_whose_range_does_not_decrease_is_misplaced() -> None:
    assert watched_front([(3.0, 0.0)] * 40) == (Beam.FRONT,)


@given(st.floats(0.4, 1.5), st.floats(20, 40), st.floats(0.5, 2.0))
def test_a_front_beam_that_grazes_a_wall_is_not_misplaced(
    aside_m: float, begin_deg: float, step_deg: float
) -> None:
    turned_deg = [begin_deg - step_deg * i for i in range(40) if begin_deg - step_deg * i > 12]
    met_m = [aside_m / math.sin(math.radians(turned)) for turned in turned_deg]
    assert watched_front(list(zip(met_m, turned_deg, strict=True))) == ()


def watched_along_a_wall(
    keeps_off_m: float, swing_deg: float, end_m: float, seed: int, seen_by: Mapping[Beam, Beam]
) -> tuple[Beam, ...]:
    """Misplaced beams of a drone that faces a wall and moves right with a swinging nose.

    Another wall is at `end_m`. Each sensor measures the beam in `seen_by`, to 5 m, within 5 cm.
    """
    random, watch = Random(seed), MountingWatch()
    east_m = forward_m = right_m = 0.0
    for tick in range(int((end_m - keeps_off_m) / 0.045)):
        turned_rad = math.radians(swing_deg) * math.sin(math.tau * 0.05 * tick / 3)
        east_m += 0.045
        forward_m += 0.045 * math.sin(turned_rad)
        right_m += 0.045 * math.cos(turned_rad)
        readings = {}
        for sensor, beam in seen_by.items():
            bearing_rad = turned_rad + BEARING_FRD_RAD[beam]
            towards = (keeps_off_m, math.cos(bearing_rad)), (end_m - east_m, math.sin(bearing_rad))
            met_m = min((away_m / cos for away_m, cos in towards if cos > 0), default=math.inf)
            readings[sensor] = RangeReading(RangeState.NOTHING)
            if met_m < 5:
                met_m = random.gauss(met_m, 0.05)
                readings[sensor] = RangeReading(RangeState.DISTANCE, met_m, 0.05**2)
        travel = forward_m, right_m, 0.0, turned_rad
        watch.take(RangeScan(0.05 * tick, readings), (0.0, east_m), travel)
    return watch.misplaced


LEVEL = {beam: beam for beam in (Beam.FRONT, Beam.LEFT, Beam.RIGHT)}


@given(st.floats(0.9, 2.0), st.floats(10, 25), st.floats(5, 20), st.integers(0, 10**6))
def test_side_beams_that_graze_the_wall_are_not_misplaced(
    keeps_off_m: float, swing_deg: float, end_m: float, seed: int
) -> None:
    """Such beams raised a false fault in six of fifteen flights in a room of 17 m."""
    assert watched_along_a_wall(keeps_off_m, swing_deg, end_m, seed, LEVEL) == ()


@pytest.mark.parametrize("seed", range(20))
def test_swapped_side_beams_are_detected_during_flight_along_a_wall(seed: int) -> None:
    """The fault comes before the drone reaches its stand-off from the next wall."""
    swapped = {Beam.FRONT: Beam.FRONT, Beam.LEFT: Beam.RIGHT, Beam.RIGHT: Beam.LEFT}
    assert Beam.LEFT in watched_along_a_wall(1.2, 5, 7.0, seed, swapped)

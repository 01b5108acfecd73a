"""The drone flies only as fast as it can stop before unswept space."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.messages import (
    BEARING_FRD_RAD,
    Beam,
    RangeReading,
    RangeScan,
    RangeState,
    RangeUnit,
    Setpoint,
)
from companion.drivers.chips.sharp import GP2Y0A710K0F
from companion.safety.drift import Drift
from companion.safety.obstacle_memory import AMONG_LEGS_S, ObstacleMemory, Surroundings
from companion.safety.swept_space import LATELY_S, LEG_M, NARROW, TO_M, WIDE, Lane, SweptGrid
from companion.safety.velocity_guard import CRAWL_M_S, MAX_GIVE_WAY_M_S, STOPS_M_S2, guarded

HERE = (7.3, -4.1)
SWING_RAD = math.radians(14)
UNITS = {beam: RangeUnit(GP2Y0A710K0F, at, 0.08) for beam, at in BEARING_FRD_RAD.items()}


def swung(bearing_rad: float = 0.0, step_deg: float = 0.5, but_rad: float = 9.0) -> SweptGrid:
    """Grid after a beam swung to both sides of a bearing, but not near one direction."""
    passed = SweptGrid()
    passed.free_hull(HERE, 10.0)
    for off_rad in np.arange(-SWING_RAD, SWING_RAD, math.radians(step_deg)):
        if abs(off_rad - but_rad) > math.radians(2.0):
            passed.sweep(HERE, bearing_rad + float(off_rad), (0.0, 3.5), 10.0)
    return passed


@pytest.mark.parametrize("bearing_deg", [0, 30, 90, 217, -45])
def test_space_is_swept_beyond_where_the_swing_is_as_wide_as_the_drone(
    bearing_deg: float,
) -> None:
    """The swing is that wide beyond 0.8 m. In flight, nearer space was swept from farther back."""
    bearing_rad = math.radians(bearing_deg)
    passed = swung(bearing_rad)
    assert passed.lane(HERE, bearing_rad, 10.1).clear_m < 0.8
    cos_b, sin_b = math.cos(bearing_rad), math.sin(bearing_rad)
    farther = HERE[0] + 0.7 * cos_b, HERE[1] + 0.7 * sin_b
    assert passed.lane(farther, bearing_rad, 10.1).clear_m > 1.5
    assert passed.lane(farther, bearing_rad + math.pi, 10.1).clear_m < 0.6


def test_a_gap_between_two_beams_limits_the_clear_distance() -> None:
    passed = swung(but_rad=math.radians(5))
    passed.free_hull((HERE[0] + 0.7, HERE[1]), 10.0)
    clear_m = passed.lane((HERE[0] + 0.7, HERE[1]), 0.0, 10.1).clear_m
    assert clear_m < 1.0


@given(
    st.floats(0.2, 1.7),
    st.floats(-0.3, 0.3),
    st.lists(st.floats(-0.3, 0.3), min_size=1, max_size=30),
    st.floats(-math.pi, math.pi),
)
def test_in_narrow_cells_beams_beside_a_leg_leave_its_cell_unswept(
    away_m: float, at_rad: float, beams_rad: list[float], heading_rad: float
) -> None:
    """Beams that pass a leg without detecting it leave the leg's cell unswept."""
    bearing_rad = heading_rad + at_rad
    leg = HERE + away_m * np.array((math.cos(bearing_rad), math.sin(bearing_rad)))
    leg = (np.floor(leg / NARROW.cell_m) + 0.5) * NARROW.cell_m
    (north_m, east_m), passed = leg - HERE, SweptGrid(NARROW)
    for off_rad in beams_rad:
        beam_rad = heading_rad + off_rad
        if abs(east_m * math.cos(beam_rad) - north_m * math.sin(beam_rad)) > LEG_M / 2:
            passed.sweep(HERE, beam_rad, (0.0, 3.5), 10.0)
    assert passed.when_s(leg[0], leg[1]) < 0


def test_in_narrow_cells_a_close_swing_sweeps_all_of_the_path() -> None:
    passed = SweptGrid(NARROW)
    passed.free_hull(HERE, 10.0)
    for off_rad in np.arange(-1.0, 1.0, math.radians(0.3)):
        passed.sweep(HERE, float(off_rad), (0.0, 3.5), 10.0)
    assert passed.lane(HERE, 0.0, 10.1).clear_m > 1.2


def test_space_swept_long_ago_counts_as_unswept() -> None:
    passed = swung()
    farther = HERE[0] + 0.7, HERE[1]
    assert passed.lane(farther, 0.0, 10.1 + LATELY_S).clear_m < 0.5


@pytest.mark.parametrize(
    ("aside_m", "since_s", "is_targeted"),
    [(0.5, 6, True), (-0.5, 6, True), (0.5, 1, False), (1.0, 6, False)],
)
def test_the_nose_turns_to_an_obstacle_beside_the_path_detected_long_ago(
    aside_m: float, since_s: float, is_targeted: bool
) -> None:
    near = ObstacleMemory(UNITS)
    nothing = RangeReading(RangeState.NOTHING)
    for yaw_deg in np.arange(-90, 90, 0.3):
        near.turn_to(math.radians(yaw_deg))
        near.see(RangeScan(1.0, {Beam.FRONT: nothing}))
    near.turn_to(math.atan2(aside_m, 1.4))
    near.see(RangeScan(1.05, {}))
    jamb_m = math.hypot(aside_m, 1.4) - 0.08
    near.see(RangeScan(1.1, {Beam.FRONT: RangeReading(RangeState.DISTANCE, jamb_m, 0.02**2)}))
    near.turn_to(0.0)
    near.move_to((0.4, 0.0))
    near.see(RangeScan(1.1 + since_s, {}))
    lane = near.surroundings(0.3).lane(0.0)
    to_it_rad, off_it_rad = lane.right_rad, lane.left_rad
    if aside_m < 0:
        to_it_rad, off_it_rad = off_it_rad, to_it_rad
    assert off_it_rad < math.radians(20)
    if is_targeted:
        assert math.degrees(to_it_rad) == pytest.approx(29, abs=1)
    else:
        assert to_it_rad < math.radians(20)


def test_a_reading_sweeps_the_space_up_to_its_range() -> None:
    near = ObstacleMemory(UNITS)
    nothing = RangeReading(RangeState.NOTHING)
    for tick, heading_rad in enumerate(np.arange(-0.5, 0.5, 0.005)):
        near.turn_to(float(heading_rad))
        near.see(RangeScan(0.05 * tick, {Beam.FRONT: nothing}))
    near.turn_to(0.0)
    near.move_to((0.4, 0.0))
    near.see(RangeScan(10.0, {Beam.FRONT: nothing}))
    around = near.surroundings(0.3)
    assert around.lane(0.0).clear_m > 1.5
    assert around.lane(math.pi / 2).clear_m < 0.5
    assert guarded(Setpoint(1.0), around, 0.3).forward_m_s > 0.9
    assert guarded(Setpoint(0.0, 1.0), around, 0.3).right_m_s < 0.5


def swing_over_a_leg(
    near: ObstacleMemory,
    wide_m: float,
    bearing_rad: float = 0.0,
    begin_s: float = 0.0,
    swing_deg: int = 15,
) -> float:
    """Swing the nose at 45 deg/s over a leg at 1.3 m, before a wall at 3 m; return the time, s."""
    there = RangeReading(RangeState.DISTANCE, 1.3 - 0.08, 0.02**2)
    behind = RangeReading(RangeState.DISTANCE, 3.0 - 0.08, 0.02**2)
    to_and_fro_deg = [*range(-swing_deg, swing_deg), *range(swing_deg, -swing_deg, -1)] * 3
    for tick, off_deg in enumerate(to_and_fro_deg):
        off_rad = math.radians(off_deg)
        near.turn_to(bearing_rad + off_rad)
        is_met = abs(1.3 * math.sin(off_rad)) < wide_m / 2
        near.see(RangeScan(begin_s + tick / 45, {Beam.FRONT: there if is_met else behind}))
    return begin_s + len(to_and_fro_deg) / 45


@pytest.mark.parametrize(
    ("wide_m", "is_leg"),
    [(0.03, True), (0.08, True), (0.4, False), (2.0, False)],
)
def test_only_a_thin_isolated_obstacle_is_a_leg(wide_m: float, is_leg: bool) -> None:
    near = ObstacleMemory(UNITS)
    swing_over_a_leg(near, wide_m, swing_deg=30)
    assert near.surroundings(0.3).is_among_legs is is_leg


def test_the_end_of_a_partition_is_no_leg() -> None:
    """Beams pass it on both sides. It was seen from the side before.

    Flights in buildings without furniture were slow for half a minute after each such end.
    """
    near = ObstacleMemory(UNITS)
    near.move_to((1.8, -1.35))
    for tick, off_deg in enumerate(range(-30, 31)):  # its side, 0.05 m west of its middle
        near.turn_to(math.pi / 2 + math.radians(off_deg))
        away_m = 1.3 / math.cos(math.radians(off_deg)) - 0.08
        side = RangeReading(RangeState.DISTANCE, away_m, 0.02**2)
        near.see(RangeScan(tick / 45, {Beam.FRONT: side}))
    near.move_to((0.0, 0.0))
    swing_over_a_leg(near, 0.1, begin_s=2.0, swing_deg=30)
    assert not near.surroundings(0.3).is_among_legs


@pytest.mark.parametrize(("legs", "stays"), [(1, False), (3, False), (4, True)])
def test_the_among_legs_state_is_permanent_after_four_legs(legs: int, stays: bool) -> None:
    """A flight reached the first leg of the next room at 0.55 m/s, two minutes after the last."""
    near = ObstacleMemory(UNITS)
    now_s = 0.0
    for leg in range(legs):
        now_s = swing_over_a_leg(near, 0.04, math.radians(40.0 * leg), now_s)
    assert near.surroundings(0.3).is_among_legs
    near.see(RangeScan(now_s + AMONG_LEGS_S + 1, {}))
    assert near.surroundings(0.3).is_among_legs is stays


@pytest.mark.parametrize("clear_m", [0.0, 0.1, 0.3, 0.6, TO_M])
@pytest.mark.parametrize(
    ("is_among_legs", "least_m_s", "most_m_s"), [(False, CRAWL_M_S, 1.0), (True, 0.0, 0.6)]
)
def test_the_drone_can_stop_before_unswept_space(
    clear_m: float, is_among_legs: bool, least_m_s: float, most_m_s: float
) -> None:
    around = Surroundings(lane=lambda _: Lane(clear_m), is_among_legs=is_among_legs)
    safe = guarded(Setpoint(0.6, -0.8, yaw_rate_rad_s=0.4), around, 0.3)
    stops_m_s = math.sqrt(2 * STOPS_M_S2 * clear_m)
    speed_m_s = math.hypot(safe.forward_m_s, safe.right_m_s)
    assert speed_m_s == pytest.approx(max(least_m_s, min(most_m_s, stops_m_s)))
    course_rad = math.atan2(safe.right_m_s, safe.forward_m_s)
    assert speed_m_s == 0 or course_rad == pytest.approx(math.atan2(-0.8, 0.6))
    assert safe.yaw_rate_rad_s == 0.4


@pytest.mark.parametrize("wall_m", [1.5, 2.0, 2.5])
def test_a_near_pole_that_reads_as_the_wall_behind_leaves_its_place_unswept(wall_m: float) -> None:
    """A drone flew against a pole whose folded readings were by chance the distance to the wall.

    The wall was also measured from 0.8 m to either side. So its readings are no folded ones.
    """
    near = ObstacleMemory(UNITS)
    for tick, off_deg in enumerate([*np.arange(-15, 15, 1.0), *np.arange(15, -15, -1.0)] * 3):
        off_rad = math.radians(float(off_deg))
        near.turn_to(math.pi + off_rad)
        leg_m = (1.3 if abs(1.3 * math.sin(off_rad)) < 0.02 else 3.0) - 0.08
        leg = RangeReading(RangeState.DISTANCE, leg_m, 0.02**2)
        near.see(RangeScan(5.0 + tick / 45, {Beam.FRONT: leg}))
    assert near.surroundings(0.3).is_among_legs
    for tick, (east_m, most_deg) in enumerate(((0.8, 30), (-0.8, 30), (0.0, 60))):
        near.move_to((0.0, east_m))
        for yaw_deg in np.arange(-most_deg, most_deg, 0.5):
            yaw_rad = math.radians(float(yaw_deg))
            near.turn_to(yaw_rad)
            reading_m = wall_m / math.cos(yaw_rad) - 0.08
            wall = RangeReading(RangeState.DISTANCE, reading_m, 0.02**2)
            near.see(RangeScan(10.0 + tick, {Beam.FRONT: wall}))
    near.turn_to(0.0)
    alias_m = GP2Y0A710K0F.alias_m(wall_m - 0.08)
    assert alias_m is not None
    assert near.surroundings(0.3).lane(0.0).clear_m < 0.08 + alias_m


def test_the_drone_gives_way_to_an_obstacle_also_into_unswept_space() -> None:
    """Among legs, wind or drift moved a drone that stood against a plant."""
    behind = np.array([[-0.35, 0.0]])
    exact, drift_m = np.zeros(1, dtype=bool), np.zeros(1)
    around = Surroundings(
        behind, is_vague=exact, drift_m=drift_m, lane=lambda _: Lane(0.0), is_among_legs=True
    )
    safe = guarded(Setpoint(), around, 0.3)
    assert 0.05 < safe.forward_m_s <= MAX_GIVE_WAY_M_S
    assert safe.right_m_s == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("half_width_m", "age_s", "is_clear"),
    [(0.25, 0.5, True), (0.25, 15.0, False), (0.5, 15.0, True), (0.5, LATELY_S + 1, False)],
)
def test_space_beside_the_path_is_swept_as_far_as_the_drone_has_drifted(
    half_width_m: float, age_s: float, is_clear: bool
) -> None:
    """A pole beside the swept path stood in the path half a minute later: odometry walks."""
    walks = Drift(walk_m2_per_s=0.005**2 / 0.1)
    passed = SweptGrid(replace(WIDE, beside_m=NARROW.beside_m))
    passed.free_hull(HERE, 10.0)
    for off_m in np.arange(-half_width_m, half_width_m, 0.02):
        passed.sweep((HERE[0], HERE[1] + float(off_m)), 0.0, (0.0, 3.5), 10.0)
    clear_m = passed.lane(HERE, 0.0, 10.0 + age_s, walks).clear_m
    assert (clear_m > 2.0) is is_clear
    assert is_clear or clear_m < 0.3


@pytest.mark.parametrize("drift_m", [0.0, 0.05, 0.1])
def test_the_drone_keeps_off_the_sides_of_a_passage_as_far_as_it_may_have_drifted(
    drift_m: float,
) -> None:
    """A drone met a post of a passage that was detected 40 s before and had drifted by 0.2 m."""
    sides = np.array([[0.0, 0.42], [0.0, -0.42]])
    exact = np.zeros(2, dtype=bool)
    around = Surroundings(sides, is_vague=exact, drift_m=np.full(2, drift_m), is_among_legs=True)
    safe = guarded(Setpoint(0.3, 0.3), around, 0.3)
    assert (abs(safe.right_m_s) < 0.05) is (drift_m > 0.08)


@pytest.mark.parametrize(("away_m", "stays_s"), [(0.5, 30.0), (1.3, 120.0)])
def test_a_gap_becomes_doubtful_while_the_drone_stays_near_a_leg(
    away_m: float, stays_s: float
) -> None:
    """A drone stayed for a minute in a pocket of posts, and drifted against one of them."""
    near = ObstacleMemory(UNITS)
    begin_s = swing_over_a_leg(near, 0.04)
    near.move_to((1.3 - away_m, 0.0), drift=Drift(0.018**2, 0.05))
    doubtful_s = [
        after_s
        for after_s in range(int(stays_s))
        if not near.see(RangeScan(begin_s + after_s, {})).readings
        and near.surroundings(0.3).is_gap_doubtful
    ]
    if away_m > 1:
        assert not doubtful_s
    else:
        assert 10 < doubtful_s[0] < 20

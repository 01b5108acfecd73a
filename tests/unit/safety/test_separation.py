"""Tests the separation of drones: by distance, by height, and by right of way."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.frames import along
from companion.core.messages import (
    BEARING_FRD_RAD,
    Beam,
    Pose,
    RangeReading,
    RangeScan,
    RangeState,
    Setpoint,
)
from companion.safety.obstacle_memory import Surroundings
from companion.safety.separation import (
    KEEP_OFF_M,
    MIN_VERTICAL_M,
    YIELD_M,
    OtherDrone,
    climb_limits,
    is_column_free,
    keep_off,
    keep_outs,
    lets_pass,
    without_others,
)
from companion.safety.velocity_guard import guarded

LEVEL_M = 1.2
AT_HOME = Pose(0.0, 0.0, 0.0, -LEVEL_M, 0.0)


def other(
    ne_m: tuple[float, float],
    height_m: float = LEVEL_M,
    *,
    yaw_rad: float = 0.8,
    yaw_off_rad: float = 0.0,
    is_flying: bool = True,
    needs_column: bool = False,
    has_right_of_way: bool = False,
) -> OtherDrone:
    flags = is_flying, needs_column, has_right_of_way
    return OtherDrone(ne_m, height_m, yaw_rad, yaw_off_rad, 0.0, *flags)


def safe(setpoint: Setpoint, near: OtherDrone, *, needs_column: bool = False) -> Setpoint:
    """The setpoint near a teammate, without any other obstacle."""
    places, distances = keep_off([near], AT_HOME, needs_column)
    around = Surroundings(others_frd_m=places, others_keep_off_m=distances)
    return guarded(setpoint, around, 0.3)


BEARING_RAD = st.floats(-math.pi, math.pi)


@given(BEARING_RAD, st.floats(0.3, YIELD_M), BEARING_RAD)
def test_no_velocity_leads_towards_a_drone_that_is_too_near(
    at_rad: float, away_m: float, course_rad: float
) -> None:
    near = other(along((0.0, 0.0), at_rad, away_m), has_right_of_way=True)
    wanted = Setpoint(math.cos(course_rad), math.sin(course_rad))
    limited = safe(wanted, near)
    closing_m_s = limited.forward_m_s * math.cos(at_rad) + limited.right_m_s * math.sin(at_rad)
    assert closing_m_s < 1e-6


def test_only_the_drone_without_the_right_of_way_gives_way() -> None:
    """They are between the two distances apart."""
    place = (0.5 * (KEEP_OFF_M + YIELD_M), 0.0)
    assert safe(Setpoint(), other(place, has_right_of_way=True)).forward_m_s < 0
    assert safe(Setpoint(), other(place)).forward_m_s == 0


def test_a_drone_in_its_column_has_the_right_of_way_at_any_height() -> None:
    place = (0.5 * (KEEP_OFF_M + YIELD_M), 0.0)
    climbing = other(place, 0.2, needs_column=True)
    assert safe(Setpoint(), climbing).forward_m_s < 0
    assert safe(Setpoint(), other(place), needs_column=True).forward_m_s == 0


def test_a_drone_on_the_ground_is_no_reason_to_give_way() -> None:
    near = other((0.5, 0.0), 0.0, is_flying=False, has_right_of_way=True)
    assert safe(Setpoint(0.3), near).forward_m_s == pytest.approx(0.3)
    assert climb_limits([near], AT_HOME, 0.4, 0.45) == (-0.4, 0.4)


def test_drones_far_enough_apart_in_height_pass_each_other() -> None:
    above = other((0.1, 0.0), LEVEL_M + MIN_VERTICAL_M + 0.01, has_right_of_way=True)
    assert safe(Setpoint(0.5), above).forward_m_s == pytest.approx(0.5)


@given(BEARING_RAD, st.floats(0.0, YIELD_M), st.floats(0.1, 1.5))
def test_a_drone_does_not_climb_or_descend_into_another(
    at_rad: float, away_m: float, apart_m: float
) -> None:
    place = along((0.0, 0.0), at_rad, away_m)
    least_m_s, most_m_s = climb_limits([other(place, LEVEL_M + apart_m)], AT_HOME, 0.4, 0.45)
    assert most_m_s == 0.4
    assert -least_m_s == pytest.approx(0.0, abs=0.4)
    assert apart_m > MIN_VERTICAL_M or least_m_s == 0
    least_m_s, most_m_s = climb_limits([other(place, LEVEL_M - apart_m)], AT_HOME, 0.4, 0.45)
    assert least_m_s == -0.4
    assert apart_m > MIN_VERTICAL_M or most_m_s == 0


def test_the_drone_without_the_right_of_way_climbs_until_the_other_is_past() -> None:
    def passes(away_m: float, *, was: bool) -> bool:
        near = other((away_m, 0.0), has_right_of_way=True)
        return lets_pass([near], AT_HOME, LEVEL_M, passes=was)

    assert not passes(2.0, was=False)
    assert passes(1.3, was=False)
    assert passes(1.8, was=True)
    assert not passes(2.1, was=True)


def test_no_drone_climbs_for_one_that_yields_or_lands_or_is_down() -> None:
    for near in (
        other((1.0, 0.0)),
        other((1.0, 0.0), has_right_of_way=True, needs_column=True),
        other((1.0, 0.0), 0.0, has_right_of_way=True),
    ):
        assert not lets_pass([near], AT_HOME, LEVEL_M, passes=False)


def test_the_column_is_free_if_no_teammate_flies_there() -> None:
    assert is_column_free([other((2.0, 0.0)), other((0.2, 0.0), 0.0, is_flying=False)], AT_HOME)
    assert not is_column_free([other((0.5, 0.0))], AT_HOME)


def at(distance_m: float) -> RangeReading:
    return RangeReading(RangeState.DISTANCE, distance_m, 1e-4)


def beams_left(scan: dict[Beam, RangeReading], near: OtherDrone) -> set[Beam]:
    kept = without_others(RangeScan(0.0, scan), AT_HOME, [near], BEARING_FRD_RAD)
    assert set(kept.readings) == set(scan)
    stale = RangeState.STALE
    return {beam for beam, reading in kept.readings.items() if reading.state is not stale}


@given(st.floats(0.8, 4.0), st.sampled_from(list(BEARING_FRD_RAD)))
def test_a_beam_that_meets_a_teammate_measures_no_wall(away_m: float, beam: Beam) -> None:
    near = other(along((0.0, 0.0), BEARING_FRD_RAD[beam], away_m))
    assert beams_left({beam: at(away_m - 0.2)}, near) == set()


def test_a_beam_measures_what_stands_before_a_teammate_and_beside_it() -> None:
    ahead = other((3.0, 0.0))
    assert beams_left({Beam.FRONT: at(2.0), Beam.RIGHT: at(2.8)}, ahead) == {Beam.FRONT, Beam.RIGHT}
    assert beams_left({Beam.FRONT: at(2.8)}, other((3.0, 1.0))) == {Beam.FRONT}
    assert beams_left({Beam.FRONT: at(2.8)}, other((3.0, 0.0), LEVEL_M + 0.75)) == {Beam.FRONT}


def test_a_beam_that_a_teammate_dazzles_measures_nothing() -> None:
    """Two infrared sensors that face each other measure any distance up to the teammate."""
    scan = {Beam.FRONT: at(1.0)}
    assert beams_left(scan, other((3.0, 0.0), yaw_rad=math.pi)) == set()
    assert beams_left(scan, other((3.0, 0.0), yaw_rad=0.5 * math.pi + 0.1)) == set()
    assert beams_left(scan, other((3.0, 0.0), yaw_rad=math.pi + 0.5)) == {Beam.FRONT}
    turns = other((3.0, 0.0), yaw_rad=math.pi + 0.5, yaw_off_rad=0.3)
    assert beams_left(scan, turns) == set()


def test_the_vertical_beams_do_not_take_a_teammate_for_ceiling_or_floor() -> None:
    scan = {Beam.UP: at(0.5), Beam.DOWN: at(1.1)}
    assert beams_left(scan, other((0.1, 0.0), LEVEL_M + 0.75)) == {Beam.DOWN}
    assert beams_left(scan, other((0.1, 0.0), 0.2)) == {Beam.UP}


def test_nothing_in_range_stays_nothing() -> None:
    scan = {Beam.FRONT: RangeReading(RangeState.NOTHING)}
    assert beams_left(scan, other((3.0, 0.0))) == {Beam.FRONT}


def test_paths_lead_round_near_teammates_with_the_right_of_way() -> None:
    near = (2.0, 1.0)
    [kept_out] = keep_outs([other(near, has_right_of_way=True)], AT_HOME, needs_column=False)
    assert kept_out.ne_m == near
    assert kept_out.radius_m == YIELD_M
    lands = other(near, LEVEL_M - 1, needs_column=True)
    assert keep_outs([lands], AT_HOME, needs_column=False)


@pytest.mark.parametrize(
    "free",
    [
        other((2.0, 1.0)),
        other((9.0, 0.0), has_right_of_way=True),
        other((2.0, 1.0), LEVEL_M + 0.8, has_right_of_way=True),
        other((2.0, 1.0), is_flying=False, has_right_of_way=True),
    ],
    ids=["gives way itself", "far", "above", "on the ground"],
)
def test_paths_do_not_lead_round_other_teammates(free: OtherDrone) -> None:
    assert not keep_outs([free], AT_HOME, needs_column=False)

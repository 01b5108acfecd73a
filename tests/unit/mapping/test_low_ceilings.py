"""Height of the drone, and areas where higher layers must not be flown."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.messages import Beam, Pose, RangeReading, RangeScan, RangeState
from companion.estimation.filters.height_filter import Height
from companion.mapping.low_ceilings import Overhead
from companion.mapping.occupancy import Occupancy
from companion.mapping.rays import Ray
from companion.navigation.grid_planner import find_ground, find_ways

TICK_S = 0.05
OFFSET_M = 0.08
CLEAR_M = 0.5
CEILING_M = 2.8


def at(distance_m: float) -> RangeReading:
    return RangeReading(RangeState.DISTANCE, distance_m, 0.02**2)


# The drone's height


@given(st.floats(-0.1, 0.1))
def test_the_down_beam_corrects_barometer_drift(drift_m: float) -> None:
    height = Height()
    height.move(1.2, TICK_S)
    for _ in range(60 * 20):
        height.move(drift_m / (60 * 20), TICK_S)
        height.see_floor(at(1.2 - OFFSET_M), OFFSET_M)
    assert height.metres == pytest.approx(1.2, abs=0.02)


@given(st.floats(0.15, 1.0))
def test_a_table_does_not_change_the_height(table_m: float) -> None:
    height = Height()
    height.move(1.2, TICK_S)
    for _ in range(200):
        height.move(0.0, TICK_S)
        height.see_floor(at(1.2 - table_m - OFFSET_M), OFFSET_M)
    assert height.metres == 1.2


def test_without_a_down_beam_the_height_is_the_autopilots() -> None:
    height = Height()
    height.move(1.2, TICK_S)
    height.see_floor(RangeReading(RangeState.FAILED), OFFSET_M)
    assert height.metres == 1.2


# Low ceilings, and obstacles below


def passed_under(up: RangeReading, times: int = 2) -> Overhead:
    """One pass to the north at a height of 1.2 m."""
    overhead = Overhead(OFFSET_M, near_limit_m=1.0)
    for _ in range(times):
        overhead.see(RangeScan(0.0, {Beam.UP: up}), Pose(0.0, 2.05, 0.05, -1.2, 0.0))
    return overhead


def test_a_lintel_is_low_and_a_ceiling_is_not() -> None:
    (place,) = passed_under(at(0.72)).lower_than(2.3, CEILING_M)
    assert place == pytest.approx((2.05, 0.05))
    assert passed_under(at(1.52)).lower_than(2.3, CEILING_M) == ()
    assert passed_under(at(0.72)).lower_than(1.7, CEILING_M) == ()


def test_a_too_near_reading_counts_as_a_low_ceiling() -> None:
    passed = passed_under(RangeReading(RangeState.TOO_NEAR))
    assert passed.lower_than(1.7, CEILING_M)
    assert not passed.lower_than(1.7, 2.2)  # the ceiling itself is too near


def test_one_stray_reading_does_not_close_a_doorway() -> None:
    assert passed_under(at(0.3), times=1).lower_than(2.3, CEILING_M) == ()


def corridor() -> Occupancy:
    """A corridor two metres wide, from 3 m south to 3 m north, with a wall at its north end."""
    grid = Occupancy()
    for _ in range(3):
        for step in range(-10, 11):
            for north_m, bearing_rad in ((-3.0, 0.0), (3.0, 3.14159)):
                grid.add(Ray((north_m, 0.1 * step), bearing_rad, 6.0, 0.02, False, 0.0))
    return grid


@pytest.mark.parametrize("low", [(), ((0.05, 0.05),)])
def test_a_higher_layer_is_free_only_above_free_space_and_not_under_low_ceilings(
    low: tuple[tuple[float, float], ...],
) -> None:
    below = corridor()
    above = below.layer_above(low)
    for _ in range(3):
        for step in range(-60, 61):
            above.add(Ray((0.05 * step, -5.0), 3.14159 / 2, 10.0, 0.02, False, 0.0))
    ways = find_ways(find_ground(above, (-2.0, 0.0), CLEAR_M))
    assert ways.reaches((2.0, 0.0)) is not bool(low)
    assert not ways.reaches((-2.0, 3.0))

"""Tests the perpendicular to the nearest wall in a 360° turn."""

import math
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.frames import wrap_rad
from companion.pdps.perpendicular import TurnReading, find_perpendicular, free_distance
from tests.examples import examples


def turn_in_a_room(walls: dict[float, float], sigma_m: float, seed: int = 1) -> list[TurnReading]:
    """Readings of a full turn. A wall is the bearing of its normal, rad, and its distance, m."""
    random = Random(seed)
    rays = []
    for tick in range(160):
        bearing = wrap_rad(tick * math.tau / 160)
        ranges = [
            distance / math.cos(bearing - normal)
            for normal, distance in walls.items()
            if math.cos(bearing - normal) > 0.05
        ]
        if ranges and min(ranges) < 5:
            rays.append(TurnReading(bearing, min(ranges) + random.gauss(0, sigma_m), 0.05))
    return rays


@settings(max_examples=examples(50))
@given(st.floats(-math.pi, math.pi), st.floats(1.5, 3.0), st.integers(0, 1000))
def test_the_perpendicular_is_found_within_8_degrees_and_12_centimetres(
    bearing: float, distance_m: float, seed: int
) -> None:
    walls = {bearing: distance_m, **{bearing + k * math.pi / 2: distance_m + 1 for k in (1, 2, 3)}}
    found = find_perpendicular(turn_in_a_room(walls, 0.05, seed))
    assert found is not None
    assert abs(math.degrees(wrap_rad(found.bearing_rad - bearing))) < 8
    assert found.distance_m == pytest.approx(distance_m, abs=0.12)


def test_a_turn_without_readings_gives_no_perpendicular() -> None:
    assert find_perpendicular([]) is None


def test_with_only_a_corner_in_range_the_shortest_reading_is_used() -> None:
    rays = [TurnReading(0.1 * i, 4.0 + 0.3 * abs(i), 0.05) for i in (-1, 0, 1)]
    found = find_perpendicular(rays)
    assert found is not None
    assert (found.bearing_rad, found.distance_m) == (0.0, 4.0)


def test_free_distance_is_the_swept_distance() -> None:
    turn = turn_in_a_room({0.0: 2.0, math.pi: 4.0}, 0.0)
    assert free_distance(turn, 0.0, 3.0) == pytest.approx(2.0, abs=0.01)
    assert free_distance(turn, math.pi, 3.0) == 3.0
    assert free_distance(turn, math.pi / 2, 3.0) == 0.0

"""Tests the landing site that replaces the start."""

import math

import pytest

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2
from companion.core.messages import Beam, Pose, RangeReading, RangeScan, RangeState
from companion.mapping.heights import Heights
from companion.mapping.occupancy import Occupancy
from companion.mapping.rays import Ray, Rays
from companion.navigation.landing_site import landing_site

PLAN = MissionConfig()
HEIGHT_M = 1.2


def flown(*track_ne_m: Vector2) -> Occupancy:
    """A round hall of 4 m with the given flown cells."""
    space = Occupancy()
    rays = [
        Ray(place, math.radians(degree), 4.0, 0.0, False, 0.0)
        for place in track_ne_m
        for degree in range(0, 360, 2)
    ]
    space.draw(Rays.of(2 * rays))
    return space


def height_map(tops_m: dict[Vector2, float]) -> Heights:
    """Height map from the down beam, with these heights at these places."""
    heights = Heights(0.0)
    for (north_m, east_m), top_m in tops_m.items():
        pose = Pose(0.0, north_m, east_m, -HEIGHT_M, 0.0)
        reading = RangeReading(RangeState.DISTANCE, HEIGHT_M - top_m, 1e-4)
        heights.see(RangeScan(0.0, {Beam.DOWN: reading}), pose)
    return heights


def line(from_m: float, to_m: float) -> list[Vector2]:
    """Places due north, 0.1 m apart."""
    return [(from_m + 0.1 * n, 0.05) for n in range(round((to_m - from_m) / 0.1))]


def test_the_site_is_not_on_the_table_below_the_drone() -> None:
    track = line(0.0, 3.0)
    heights = height_map({place: 0.45 if place[0] > 2.0 else 0.0 for place in track})
    north_m, _ = landing_site((2.8, 0.05), flown(*track), heights, PLAN)
    assert north_m < 2.0 - 0.4


def test_the_site_is_no_farther_away_than_necessary() -> None:
    track = line(0.0, 3.0)
    heights = height_map({place: 0.45 if place[0] > 2.0 else 0.0 for place in track})
    north_m, _ = landing_site((2.8, 0.05), flown(*track), heights, PLAN)
    assert north_m > 1.0


def test_over_floor_the_site_is_directly_below() -> None:
    track = line(0.0, 3.0)
    assert landing_site(
        (1.5, 0.05), flown(*track), height_map(dict.fromkeys(track, 0.0)), PLAN
    ) == (pytest.approx((1.5, 0.05), abs=0.11))


def test_without_a_known_floor_the_site_is_directly_below() -> None:
    track = line(0.0, 3.0)
    assert landing_site((2.8, 0.05), flown(*track), Heights(0.0), PLAN) == (2.8, 0.05)


def test_the_site_is_not_behind_a_wall() -> None:
    track = line(0.0, 3.0)
    heights = height_map({place: 0.45 if place[0] > 2.0 else 0.0 for place in track})
    space = flown(*line(2.2, 3.0))
    for east in range(-40, 41):
        for _ in range(5):
            space.add(Ray((2.8, 0.1 * east), math.pi, 0.9, 0.0, True, 0.0))
    assert landing_site((2.8, 0.05), space, heights, PLAN)[0] > 2.0

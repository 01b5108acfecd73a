"""Tests the stand-off distance from the sensor model."""

import pytest

from companion.drivers.chips.sharp import GP2Y0A710K0F, PAPER, PROFILES
from companion.navigation.standoff import standoff_m

OFFSET_M = 0.08


def test_metres_are_metres() -> None:
    assert standoff_m(1.7, PAPER, OFFSET_M) == 1.7


def test_the_papers_range_adjustment_goes_close_to_the_maximum() -> None:
    assert 4.5 < standoff_m("range", PAPER, OFFSET_M) < PAPER.max_m


def test_as_far_as_the_range_goes_a_wall_is_still_surely_seen() -> None:
    away_m = standoff_m("range", GP2Y0A710K0F, OFFSET_M)
    assert away_m + 2 * GP2Y0A710K0F.sigma_m(away_m) < GP2Y0A710K0F.max_m
    assert away_m > 3


def test_accurate_is_where_the_noise_is_least() -> None:
    away_m = standoff_m("accurate", GP2Y0A710K0F, OFFSET_M)
    assert 1.0 < away_m < 1.6
    assert GP2Y0A710K0F.sigma_m(away_m) < GP2Y0A710K0F.sigma_m(2.0)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("wanted", ["range", "accurate"])
def test_it_is_where_the_sensor_can_measure(profile: str, wanted: str) -> None:
    sensor = PROFILES[profile]
    away_m = standoff_m("range" if wanted == "range" else "accurate", sensor, OFFSET_M)
    assert max(sensor.min_m, 0.6) < away_m < sensor.max_m


def test_a_drone_whose_estimate_wanders_keeps_farther_off() -> None:
    steady_m = standoff_m("accurate", GP2Y0A710K0F, OFFSET_M)
    away_m = standoff_m("accurate", GP2Y0A710K0F, OFFSET_M, wander_m=0.07)
    assert steady_m + 0.15 < away_m < 2.0
    assert standoff_m("range", PAPER, OFFSET_M, wander_m=0.07) < PAPER.max_m

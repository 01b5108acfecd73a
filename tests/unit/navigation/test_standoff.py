"""Tests the stand-off distance from the sensor model."""

import pytest

from companion.drivers.chips.sharp import GP2Y0A710K0F, PAPER, PROFILES
from companion.navigation.standoff import standoff_m

OFFSET_M = 0.08


def test_a_stand_off_in_metres_is_used_unchanged() -> None:
    assert standoff_m(1.7, PAPER, OFFSET_M) == 1.7


def test_range_stand_off_of_the_paper_is_close_to_the_maximum_range() -> None:
    assert 4.5 < standoff_m("range", PAPER, OFFSET_M) < PAPER.max_m


def test_range_stand_off_leaves_two_sigmas_to_the_maximum_range() -> None:
    away_m = standoff_m("range", GP2Y0A710K0F, OFFSET_M)
    assert away_m + 2 * GP2Y0A710K0F.sigma_m(away_m) < GP2Y0A710K0F.max_m
    assert away_m > 3


def test_accurate_stand_off_is_where_the_noise_is_lowest() -> None:
    away_m = standoff_m("accurate", GP2Y0A710K0F, OFFSET_M)
    assert 1.0 < away_m < 1.6
    assert GP2Y0A710K0F.sigma_m(away_m) < GP2Y0A710K0F.sigma_m(2.0)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("wanted", ["range", "accurate"])
def test_stand_off_is_within_the_measuring_range(profile: str, wanted: str) -> None:
    sensor = PROFILES[profile]
    away_m = standoff_m("range" if wanted == "range" else "accurate", sensor, OFFSET_M)
    assert max(sensor.min_m, 0.6) < away_m < sensor.max_m


def test_drift_of_the_estimate_increases_the_stand_off() -> None:
    steady_m = standoff_m("accurate", GP2Y0A710K0F, OFFSET_M)
    away_m = standoff_m("accurate", GP2Y0A710K0F, OFFSET_M, wander_m=0.07)
    assert steady_m + 0.15 < away_m < 2.0
    assert standoff_m("range", PAPER, OFFSET_M, wander_m=0.07) < PAPER.max_m

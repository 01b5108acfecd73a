"""The Sharp sensor: curve, noise and limits."""

import math
import statistics
from dataclasses import replace
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.messages import RangeState
from companion.drivers.chips import ads1115
from companion.drivers.chips.sharp import GP2Y0A710K0F, PAPER, PROFILES
from sitl.sensors.ads1115 import Ads1115Device
from sitl.sensors.i2c import DeviceBus
from sitl.sensors.inputs import AdcInputs
from sitl.sensors.sharp import PHYSICS, SharpPhysics, SharpUnit


@given(st.floats(1.0, 5.5))
def test_the_driver_inverts_the_datasheets_curve(distance_m: float) -> None:
    reading = GP2Y0A710K0F.reading(GP2Y0A710K0F.volts(distance_m))
    assert reading.distance_m == pytest.approx(distance_m, abs=1e-6)


@given(st.floats(0.02, 5.0))
def test_the_papers_sensor_is_linear(distance_m: float) -> None:
    reading = PAPER.reading(PAPER.volts(distance_m))
    assert reading.distance_m == pytest.approx(distance_m, abs=1e-6)
    assert math.sqrt(reading.variance_m2) == pytest.approx(0.05)


@pytest.mark.parametrize("name", PROFILES)
@given(volts=st.floats(-1, 6))
def test_a_distance_is_never_outside_the_sensors_range(name: str, volts: float) -> None:
    profile = PROFILES[name]
    reading = profile.reading(volts)
    if reading.is_distance:
        assert profile.min_m - 1e-9 <= reading.distance_m <= profile.max_m + 1e-9
        assert reading.variance_m2 > 0
    elif reading.state is RangeState.TOO_NEAR:
        assert not reading.distance_m > profile.min_m
    else:
        assert math.isnan(reading.distance_m)


@given(st.floats(0.14, 0.42))
def test_the_alias_of_a_folded_back_reading_is_the_true_distance(distance_m: float) -> None:
    read_m = GP2Y0A710K0F.reading(GP2Y0A710K0F.volts(distance_m)).distance_m
    assert read_m >= GP2Y0A710K0F.min_m - 1e-9
    assert GP2Y0A710K0F.alias_m(read_m) == pytest.approx(distance_m, abs=0.02)


@given(st.floats(0.55, 0.99))
def test_a_too_near_reading_contains_an_estimate_of_the_distance(distance_m: float) -> None:
    reading = GP2Y0A710K0F.reading(GP2Y0A710K0F.volts(distance_m))
    assert reading.state is RangeState.TOO_NEAR
    assert reading.distance_m == pytest.approx(distance_m, abs=0.02)


def test_noise_grows_with_the_square_of_distance() -> None:
    near, far = GP2Y0A710K0F.sigma_m(1.1), GP2Y0A710K0F.sigma_m(4.4)
    assert 8 < far / near < 24


@pytest.mark.parametrize(
    ("volts", "state"),
    [
        *((v, RangeState.FAILED) for v in (-0.1, 0.0, 0.15, 0.25, 0.57, 0.9, 1.1, 1.18)),
        *((v, RangeState.FAILED) for v in (3.25, 3.3, 3.6, 4.096, 5.0)),
        (1.22, RangeState.NOTHING),
        (3.13, RangeState.TOO_NEAR),
        (2.8, RangeState.TOO_NEAR),
        (1.3, RangeState.NOTHING),
        (1.8, RangeState.DISTANCE),
    ],
)
def test_the_voltage_determines_the_state_of_the_reading(volts: float, state: RangeState) -> None:
    assert GP2Y0A710K0F.reading(volts).state is state


@pytest.mark.parametrize("volts", [0.0, 0.3, 0.57, 0.9, 1.05, 3.02, 3.2, 3.3, 5.0])
def test_a_voltage_that_the_ideal_sensor_does_not_output_is_a_fault(volts: float) -> None:
    assert PAPER.reading(volts).state is RangeState.FAILED


@pytest.mark.parametrize("name", PROFILES)
@given(distance_m=st.none() | st.floats(0.05, 10.0), sigmas=st.floats(-5, 5))
def test_no_output_of_a_powered_sensor_is_a_fault(
    name: str, distance_m: float | None, sigmas: float
) -> None:
    profile = PROFILES[name]
    if distance_m is not None and not profile.noise_v:
        distance_m = max(distance_m + sigmas * profile.sigma_m(distance_m), 0.0)
    volts = profile.volts(distance_m) + sigmas * profile.noise_v
    assert profile.reading(volts).is_alive


def test_an_obstacle_at_30_cm_reads_as_more_than_1_5_m() -> None:
    """The driver cannot detect this aliasing: ranges below half a metre are not reliable."""
    folded = GP2Y0A710K0F.reading(GP2Y0A710K0F.volts(0.3))
    assert folded.is_distance
    assert folded.distance_m > 1.5


@pytest.mark.parametrize(
    ("distance_m", "volts"),
    [(1.0, 2.50), (1.4, 2.10), (2.0, 1.80), (3.2, 1.52), (4.4, 1.42), (5.5, 1.37)],
)
def test_the_curve_goes_through_the_datasheets_points(distance_m: float, volts: float) -> None:
    assert GP2Y0A710K0F.volts(distance_m) == pytest.approx(volts)


@given(st.floats(1.0, 5.5), st.floats(1.0, 5.5))
def test_the_voltage_falls_with_the_distance_within_the_range(a_m: float, b_m: float) -> None:
    near_m, far_m = sorted((a_m, b_m))
    assert GP2Y0A710K0F.volts(near_m) >= GP2Y0A710K0F.volts(far_m)


@given(st.floats(0.0, 0.5), st.floats(0.0, 0.5))
def test_below_half_a_metre_the_curve_folds_back(a_m: float, b_m: float) -> None:
    near_m, far_m = sorted((a_m, b_m))
    assert GP2Y0A710K0F.volts(near_m) <= GP2Y0A710K0F.volts(far_m)


GP2Y = PHYSICS["gp2y0a710k0f"]
QUIET = replace(GP2Y, output_noise_v=0.0)


def units(physics: SharpPhysics, count: int, distance_m: float = 2.0) -> list[SharpUnit]:
    return [SharpUnit(physics, lambda time_s: distance_m, Random(seed)) for seed in range(count)]


def refreshes_s(unit: SharpUnit, until_s: float) -> list[float]:
    """Times of output changes, s, to 0.1 ms. The noise differs after each change."""
    times_s = [step * 1e-4 for step in range(round(until_s / 1e-4))]
    volts = [unit.volts(time_s) for time_s in times_s]
    changes = zip(times_s[1:], pairwise(volts), strict=True)
    return [time_s for time_s, (before, after) in changes if before != after]


def test_a_unit_holds_its_output_for_its_own_period() -> None:
    periods_s = []
    for unit in units(GP2Y, 30):
        times_s = refreshes_s(unit, 0.3)
        gaps_s = [b - a for a, b in pairwise(times_s)]
        periods_s.append(statistics.mean(gaps_s))
        assert max(gaps_s) - min(gaps_s) < 2.5e-4
    assert statistics.mean(periods_s) == pytest.approx(0.0165, rel=0.03)
    assert statistics.stdev(periods_s) == pytest.approx(0.05 * 0.0165, rel=0.4)


def test_units_do_not_refresh_together() -> None:
    first_s = sorted(refreshes_s(unit, 0.03)[0] for unit in units(GP2Y, 100))
    quarters = [sum(low <= t < low + 0.004 for t in first_s) for low in (0, 0.004, 0.008, 0.012)]
    assert min(quarters) > 10


def test_the_output_has_ten_millivolts_of_noise() -> None:
    (unit,) = units(GP2Y, 1)
    volts = [unit.volts(0.05 * i) for i in range(4000)]
    assert statistics.stdev(volts) == pytest.approx(0.010, rel=0.05)


def test_units_differ_in_gain() -> None:
    read_m = [GP2Y0A710K0F.reading(unit.volts(1.0)).distance_m for unit in units(QUIET, 1000)]
    assert statistics.mean(read_m) == pytest.approx(2.0, rel=0.001)
    assert statistics.stdev(read_m) / 2.0 == pytest.approx(0.003, rel=0.1)


@given(st.floats(0, 4.095))
def test_the_adc_rounds_to_its_counts(volts: float) -> None:
    bus = DeviceBus({0x48: Ads1115Device(lambda channel, time_s: volts)})
    read_v = ads1115.ConversionSweep([(0x48, 0)]).volts(bus)[0x48, 0]
    assert abs(read_v - volts) <= 125e-6 / 2 + 1e-12
    assert read_v / 125e-6 == pytest.approx(round(read_v / 125e-6), abs=1e-6)


def test_an_open_input_floats_and_follows_the_channel_converted_before_it() -> None:
    levels_v = []
    for seed in range(20):
        (powered,) = units(QUIET, 1, distance_m=1.0)
        (unplugged,) = units(QUIET, 1)
        inputs = AdcInputs({0: powered, 1: unplugged}, Random(seed))
        unplugged.is_unplugged = True
        high_v = [(inputs.volts(0, 0.05 * i), inputs.volts(1, 0.05 * i))[1] for i in range(50)]
        powered.true_range = lambda time_s: 5.0
        low_v = [(inputs.volts(0, 5 + i), inputs.volts(1, 5 + i))[1] for i in range(50)]
        assert all(0.1 < volts < 1.1 for volts in (*high_v, *low_v))
        assert 0.001 < statistics.stdev(high_v) < 0.006
        assert statistics.mean(high_v) - statistics.mean(low_v) > 0.05
        levels_v.append(statistics.mean(low_v))
    assert statistics.stdev(levels_v) > 0.05

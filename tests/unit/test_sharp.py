"""The Sharp sensor: its curve, its noise, and what it cannot see."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.drivers.sharp import GP2Y0A710K0F, PAPER, PROFILES
from companion.messages import RangeState


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
    else:
        assert math.isnan(reading.distance_m)


def test_noise_grows_with_the_square_of_distance() -> None:
    near, far = GP2Y0A710K0F.sigma_m(1.1), GP2Y0A710K0F.sigma_m(4.4)
    assert 8 < far / near < 24


@pytest.mark.parametrize(
    ("volts", "state"),
    [
        (0.0, RangeState.FAILED),
        (3.6, RangeState.FAILED),
        (2.8, RangeState.TOO_NEAR),
        (1.3, RangeState.NOTHING),
        (1.8, RangeState.DISTANCE),
    ],
)
def test_the_states_of_a_voltage(volts: float, state: RangeState) -> None:
    assert GP2Y0A710K0F.reading(volts).state is state


def test_very_near_things_read_as_metres() -> None:
    """The fold-back: the driver cannot know, so nobody may rely on it below half a metre."""
    folded = GP2Y0A710K0F.reading(GP2Y0A710K0F.volts(0.3))
    assert folded.is_distance
    assert folded.distance_m > 1.5

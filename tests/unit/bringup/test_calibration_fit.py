"""Calibration: gain and offset of a range unit by tape measure, gain of the gyro by turns."""

import math
from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.devices.calibration import GAIN, PROFILES, calibrated_unit
from companion.bringup.calibration_fit import (
    CalibrationError,
    TapePoint,
    fit,
    tape_point,
    turn_gain,
)
from companion.config import settings as configuration
from companion.core.errors import ConfigError
from companion.core.messages import RangeReading, RangeState
from companion.drivers.ranges import corrected


@pytest.mark.parametrize("profile", PROFILES)
def test_a_gain_error_of_five_percent_is_fitted_to_three_permille(profile: str) -> None:
    found = calibrated_unit(profile, seed=1)
    assert found.calibration.gain / GAIN == pytest.approx(1.0, abs=0.003)


@given(st.floats(0.8, 1.2), st.floats(-0.02, 0.02))
def test_without_noise_gain_and_offset_are_exact(gain: float, offset_m: float) -> None:
    points = [TapePoint(d, gain * d + offset_m, 1e-5) for d in (1.2, 1.6, 2.0, 3.0)]
    found = fit(points)
    assert found.calibration.gain == pytest.approx(gain, abs=2e-4)
    assert found.calibration.offset_m == pytest.approx(offset_m, abs=5e-4)
    for point in points:
        reading = corrected(
            RangeReading(RangeState.DISTANCE, point.measured_m, 0.01), found.calibration
        )
        assert reading.distance_m == pytest.approx(point.true_m, abs=1e-3)


def test_the_reported_gain_sigma_equals_the_spread_of_many_fits() -> None:
    random = Random(1)
    gains = []
    for _ in range(400):
        points = [TapePoint(d, d + random.gauss(0, 0.004), 0.004) for d in (1.2, 1.6, 2.0, 2.5)]
        found = fit(points)
        gains.append(found.calibration.gain)
    spread = math.sqrt(sum((gain - 1) ** 2 for gain in gains) / len(gains))
    assert found.gain_sigma == pytest.approx(spread, rel=0.2)


@pytest.mark.parametrize("distances", [(1.0, 2.0), (1.0, 1.1, 1.2)])
def test_too_few_or_too_close_distances_are_refused(distances: tuple[float, ...]) -> None:
    with pytest.raises(CalibrationError, match="three to five"):
        fit([TapePoint(d, d, 0.001) for d in distances])


def test_another_beams_distances_are_refused() -> None:
    with pytest.raises(CalibrationError, match="does this beam"):
        fit([TapePoint(d, 0.3, 0.001) for d in (1.0, 2.0, 3.0)])


def test_a_distance_out_of_range_is_refused_with_the_states_of_its_readings() -> None:
    nothing = [RangeReading(RangeState.NOTHING)] * 100
    with pytest.raises(CalibrationError, match=r"at 7 m only 0 of 100.*nothing in range"):
        tape_point(7.0, nothing)


def test_full_turns_determine_the_gyro_gain() -> None:
    assert turn_gain(2 * math.tau * 0.98, 2) == pytest.approx(0.98)


@pytest.mark.parametrize("turned", [-math.tau, 0.5 * math.tau])
def test_an_anticlockwise_turn_or_half_a_turn_is_refused(turned: float) -> None:
    with pytest.raises(CalibrationError, match="clockwise"):
        turn_gain(turned, 1)


def test_writing_a_calibration_keeps_the_rest_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "drone.toml"
    path.write_text("# mine\n[sensors]\nrest_s = 5   # longer\n\n[mission]\nkind = 'room'\n")
    configuration.update(path, "sensors.calibration.front", {"gain": 1.05, "offset_m": 0.01})
    configuration.update(path, "sensors.calibration.left", {"gain": 0.99, "offset_m": 0.0})
    configuration.update(path, "sensors.gyro_gain", 1.02)
    text = path.read_text()
    assert "# mine" in text
    assert "# longer" in text
    sensors = configuration.load(path).sensors
    assert sensors.calibration["front"].gain == 1.05  # type: ignore[index]
    assert sensors.calibration["left"].gain == 0.99  # type: ignore[index]
    assert (sensors.gyro_gain, sensors.rest_s) == (1.02, 5)


def test_writing_a_calibration_creates_a_missing_file(tmp_path: Path) -> None:
    path = tmp_path / "new.toml"
    configuration.update(path, "sensors.calibration.up", {"gain": 1.01, "offset_m": 0.0})
    assert configuration.load(path).sensors.calibration


def test_a_value_out_of_bounds_is_not_written(tmp_path: Path) -> None:
    path = tmp_path / "drone.toml"
    with pytest.raises(ConfigError, match="gyro_gain"):
        configuration.update(path, "sensors.gyro_gain", 7.0)
    assert not path.exists()

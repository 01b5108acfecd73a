"""What a tape measure and a full turn say of a unit: gain and offset, and how sure they are."""

import math
from collections.abc import Sequence

import numpy as np

from companion.config.range_sensors import Calibration
from companion.core.errors import CompanionError
from companion.core.messages import RangeReading
from companion.core.values import value

OFFSET_SIGMA_M = 0.03
"""Beforehand: where in its case a sensor begins to measure, and where the tape is held."""
MIN_SPAN = 1.5
"""Of the farthest distance over the nearest; nearer together they do not tell a gain."""
MIN_READINGS = 20
GAIN_BOUNDS = (0.5, 2.0)


class CalibrationError(CompanionError, ValueError):
    """Measurements that do not tell a calibration; says what to do instead."""


@value
class TapePoint:
    """What a unit told at one distance by the tape measure."""

    true_m: float
    measured_m: float
    """Mean of the readings."""
    sigma_m: float
    """Of that mean."""


@value
class Fit:
    """told = gain × true + offset, and what is left."""

    calibration: Calibration
    gain_sigma: float
    residual_m: float
    """Root mean square over the distances."""


def tape_point(true_m: float, readings: Sequence[RangeReading]) -> TapePoint:
    """The mean of what was read at a distance.

    Raises:
        CalibrationError: too few of them were distances.
    """
    measured_m = [reading.distance_m for reading in readings if reading.is_distance]
    if len(measured_m) < MIN_READINGS or len(measured_m) < 0.8 * len(readings):
        states = ", ".join(sorted({reading.state.value for reading in readings}))
        raise CalibrationError(
            f"at {true_m:g} m only {len(measured_m)} of {len(readings)} readings were distances "
            f"({states}); choose distances within the sensor's range, and a flat light board"
        )
    return TapePoint(
        true_m, float(np.mean(measured_m)), float(np.std(measured_m)) / math.sqrt(len(measured_m))
    )


def fit(points: Sequence[TapePoint]) -> Fit:
    """Weighted least squares over the distances, with what is known of offsets beforehand.

    Raises:
        CalibrationError: fewer than three distances, or all of them close together.
    """
    true_m = np.array([point.true_m for point in points])
    if len(points) < 3 or true_m.max() < MIN_SPAN * true_m.min():
        raise CalibrationError(
            f"{len(points)} distances from {true_m.min():g} to {true_m.max():g} m tell no gain; "
            f"measure at three to five, the farthest {MIN_SPAN:g} times the nearest or more"
        )
    measured_m = np.array([point.measured_m for point in points])
    weights = 1 / np.maximum([point.sigma_m for point in points], 1e-4)
    design = np.column_stack([true_m, np.ones_like(true_m)])
    weighted = np.vstack([design * weights[:, None], [[0.0, 1 / OFFSET_SIGMA_M]]])
    gain, offset_m = np.linalg.lstsq(weighted, np.append(measured_m * weights, 0.0), rcond=None)[0]
    residual_m = math.sqrt(np.mean((measured_m - design @ [gain, offset_m]) ** 2))
    gain_sigma = math.sqrt(np.linalg.inv(weighted.T @ weighted)[0, 0])
    if not GAIN_BOUNDS[0] <= gain <= GAIN_BOUNDS[1]:
        raise CalibrationError(
            f"a gain of {gain:.2f} is no unit's; is it this beam that looks at the board?"
        )
    calibration = Calibration(gain=round(float(gain), 5), offset_m=round(float(offset_m), 5))
    return Fit(calibration, gain_sigma, residual_m)


def turn_gain(turned_rad: float, turns: int) -> float:
    """Of a gyro that was turned clockwise by whole turns, its bias taken off.

    Raises:
        CalibrationError: it turned the other way, or by something else.
    """
    gain = turned_rad / (turns * math.tau)
    if not 0.8 <= gain <= 1.2:
        raise CalibrationError(
            f"it told {math.degrees(turned_rad):.0f}° of {360 * turns}°; turn it clockwise seen "
            "from above, by whole turns, and mount the chip with its z axis up"
        )
    return round(gain, 5)

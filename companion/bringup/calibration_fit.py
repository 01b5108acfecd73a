"""Fits gain and offset of a unit by tape measure, and a gyro's gain by full turns."""

import math
from collections.abc import Sequence

import numpy as np

from companion.config.range_sensors import Calibration
from companion.core.errors import CompanionError
from companion.core.messages import RangeReading
from companion.core.values import value

OFFSET_SIGMA_M = 0.03
"""Prior sigma of the offset, m: origin of the measurement in the case, and position of the tape.
Chosen."""
MIN_SPAN = 1.5
"""Least ratio of the largest to the smallest distance; below it the gain is not determined.
Chosen."""
MIN_READINGS = 20
"""Least readings at one distance. Chosen."""
GAIN_BOUNDS = (0.5, 2.0)
"""Plausible gains. Chosen."""


class CalibrationError(CompanionError, ValueError):
    """The measurements do not determine a calibration; the message contains the remedy."""


@value
class TapePoint:
    """Readings of a unit at one distance by tape measure."""

    true_m: float
    measured_m: float
    """Mean of the readings."""
    sigma_m: float
    """Sigma of that mean."""


@value
class Fit:
    """reading = gain × true + offset, and the residual."""

    calibration: Calibration
    gain_sigma: float
    residual_m: float
    """Root mean square over the distances."""


def tape_point(true_m: float, readings: Sequence[RangeReading]) -> TapePoint:
    """Mean of the readings at one distance.

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
    """Weighted least squares over the distances, with a prior on the offset.

    Raises:
        CalibrationError: fewer than three distances, or all of them close together.
    """
    true_m = np.array([point.true_m for point in points])
    if len(points) < 3 or true_m.max() < MIN_SPAN * true_m.min():
        raise CalibrationError(
            f"{len(points)} distances from {true_m.min():g} to {true_m.max():g} m give no gain; "
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
            f"a gain of {gain:.2f} is not plausible; does this beam point at the board?"
        )
    calibration = Calibration(gain=round(float(gain), 5), offset_m=round(float(offset_m), 5))
    return Fit(calibration, gain_sigma, residual_m)


def turn_gain(turned_rad: float, turns: int) -> float:
    """Gain of a gyro that was turned clockwise by whole turns, bias removed.

    Raises:
        CalibrationError: the turn had another direction or size.
    """
    gain = turned_rad / (turns * math.tau)
    if not 0.8 <= gain <= 1.2:
        raise CalibrationError(
            f"measured {math.degrees(turned_rad):.0f}° of {360 * turns}°; turn it clockwise seen "
            "from above, by whole turns, and mount the chip with its z axis up"
        )
    return round(gain, 5)

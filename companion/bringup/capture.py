"""Measures for a calibration: readings at a distance, a rest, and a turn."""

import math
from collections.abc import Iterator

from companion.bringup.calibration_fit import CalibrationError
from companion.core.messages import Beam, GyroSample, RangeModel, RangeReading
from companion.drivers.chips.sharp import SharpProfile
from companion.estimation.filters.gyro_rest_calibration import RestCalibration
from companion.run.loop import Rig
from companion.safety.health.lateness import TICK_S

SETTLE_S = 0.5
"""Readings of this first period are discarded, s. Chosen."""
STILL_RAD_S = math.radians(2.0)
"""A lower rate is rest, rad/s. Chosen."""
STILL_FOR_S = 2.0
"""Rest of this length ends a turn, s. Chosen."""
MIN_TURN_RAD = math.radians(90)
"""A smaller turn is not a measurement, rad. Chosen."""
TIMEOUT_S = 120.0
"""Longest wait for a rest or a turn, s. Chosen."""


def suggested_distances_m(model: RangeModel) -> tuple[float, ...]:
    """Five distances in the part of the range with low noise and without cut-off readings."""
    if isinstance(model, SharpProfile):
        return 1.2, 1.4, 1.7, 2.0, 2.5
    return 0.5, 1.0, 1.5, 2.0, 3.0


def _ticks(rig: Rig, for_s: float) -> Iterator[float]:
    """Times of the ticks of a period; keeps the link alive."""
    now_s = began_s = rig.clock.wait_until(0.0)
    while now_s < began_s + for_s - 1e-6:
        now_s = rig.clock.wait_until(now_s + TICK_S)
        rig.link.poll(now_s)
        rig.link.send(now_s, None, None)
        yield now_s


def readings_of(rig: Rig, beam: Beam, for_s: float) -> list[RangeReading]:
    """A beam's readings over a period, after older ones have been discarded."""
    for now_s in _ticks(rig, SETTLE_S):
        rig.ranges.read(now_s)
    return [rig.ranges.read(now_s).readings[beam] for now_s in _ticks(rig, for_s)]


def rest_bias_rad_s(rig: Rig, for_s: float) -> float:
    """The gyro's bias, once it has been at rest for `for_s`.

    Raises:
        CalibrationError: the gyro is silent, or never at rest.
    """
    rest = RestCalibration(for_s)
    has_samples = False
    for now_s in _ticks(rig, for_s + TIMEOUT_S):
        samples = rig.gyro.read(now_s)
        has_samples |= bool(samples)
        rest.add(samples)
        if rest.bias_rad_s is not None:
            return rest.bias_rad_s
    raise CalibrationError(
        "the gyro was never at rest; put the drone down" if has_samples else "the gyro is silent"
    )


def turn_rad(rig: Rig, bias_rad_s: float) -> float:
    """The turn from now until the next rest, clockwise.

    Raises:
        CalibrationError: no turn.
    """
    turned_rad = still_s = 0.0
    last: GyroSample | None = None
    for now_s in _ticks(rig, TIMEOUT_S):
        for sample in rig.gyro.read(now_s):
            rate = sample.yaw_rate_rad_s - bias_rad_s
            dt_s = sample.time_s - last.time_s if last else 0.0
            turned_rad += rate * dt_s
            still_s = still_s + dt_s if abs(rate) < STILL_RAD_S else 0.0
            last = sample
        if still_s >= STILL_FOR_S and abs(turned_rad) > MIN_TURN_RAD:
            return turned_rad
    raise CalibrationError(f"no turn within {TIMEOUT_S:.0f} s")

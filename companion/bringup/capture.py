"""Measuring for a calibration: readings at a distance, a rest, and a turn."""

import math
from collections.abc import Iterator

from companion.bringup.calibration_fit import CalibrationError
from companion.core.messages import Beam, GyroSample, RangeModel, RangeReading
from companion.drivers.chips.sharp import SharpProfile
from companion.estimation.filters.gyro_rest_calibration import RestCalibration
from companion.run.loop import Rig
from companion.safety.health.lateness import TICK_S

SETTLE_S = 0.5
STILL_RAD_S = math.radians(2.0)
STILL_FOR_S = 2.0
"""After a turn: it is over."""
MIN_TURN_RAD = math.radians(90)
PATIENCE_S = 120.0


def suggested_distances_m(model: RangeModel) -> tuple[float, ...]:
    """Five, in the part of the range where the noise is low and no reading falls off its ends."""
    if isinstance(model, SharpProfile):
        return 1.2, 1.4, 1.7, 2.0, 2.5
    return 0.5, 1.0, 1.5, 2.0, 3.0


def _ticks(rig: Rig, for_s: float) -> Iterator[float]:
    """The times of a while, with the link kept up."""
    now_s = began_s = rig.clock.wait_until(0.0)
    while now_s < began_s + for_s - 1e-6:
        now_s = rig.clock.wait_until(now_s + TICK_S)
        rig.link.poll(now_s)
        rig.link.send(now_s, None, None)
        yield now_s


def readings_of(rig: Rig, beam: Beam, for_s: float) -> list[RangeReading]:
    """What a beam tells in a while, after what is left from before has gone."""
    for now_s in _ticks(rig, SETTLE_S):
        rig.ranges.read(now_s)
    return [rig.ranges.read(now_s).readings[beam] for now_s in _ticks(rig, for_s)]


def rest_bias_rad_s(rig: Rig, for_s: float) -> float:
    """The gyro's bias, once it has stood still for so long.

    Raises:
        CalibrationError: it is silent, or never still.
    """
    rest = RestCalibration(for_s)
    heard = False
    for now_s in _ticks(rig, for_s + PATIENCE_S):
        samples = rig.gyro.read(now_s)
        heard |= bool(samples)
        rest.add(samples)
        if rest.bias_rad_s is not None:
            return rest.bias_rad_s
    raise CalibrationError(
        "the gyro was never still; put the drone down" if heard else "the gyro is silent"
    )


def turn_rad(rig: Rig, bias_rad_s: float) -> float:
    """How far it is turned from now on, clockwise, until it has come to rest again.

    Raises:
        CalibrationError: nobody turns it.
    """
    turned_rad = still_s = 0.0
    last: GyroSample | None = None
    for now_s in _ticks(rig, PATIENCE_S):
        for sample in rig.gyro.read(now_s):
            rate = sample.yaw_rate_rad_s - bias_rad_s
            dt_s = sample.time_s - last.time_s if last else 0.0
            turned_rad += rate * dt_s
            still_s = still_s + dt_s if abs(rate) < STILL_RAD_S else 0.0
            last = sample
        if still_s >= STILL_FOR_S and abs(turned_rad) > MIN_TURN_RAD:
            return turned_rad
    raise CalibrationError(f"it has not been turned within {PATIENCE_S:.0f} s")

"""Checks that a log's numbers are plausible seconds, metres and radians.

Rows in other units give a wrong map or none. A clock that was set during the recording mixes rows
of two times.
"""

import math

import numpy as np

from companion.core.arrays import Array
from companion.core.errors import LogError

MIN_ROWS = 10
"""A shorter log is not checked. Chosen."""
MAX_INTERVAL_S, MIN_INTERVAL_S = 5.0, 1e-4
"""Limits of the median interval of rows, s. Chosen: rows of most logs are 0.05 to 1 s apart, those
of some old robots 3 to 4 s; rows at 200 Hz in milliseconds would be 5 s apart."""
TIME_UNITS = ((3e3, "milliseconds", "1000"), (3e6, "microseconds", "1e6"))
"""Up to the first value as median interval, the unit probably is the second, with the divisor."""
MAX_REPEATED = 0.5
"""Largest share of rows that repeat a time. Chosen."""
MAX_LEAP_S = 3600.0
"""Largest gap in time, s. Chosen."""
SET_BACK_S = 1.0
"""Rows may be out of order by less, s. Chosen."""
MIN_OVERLAP = 3
"""Least rows that continue at the earlier time, and least rows that they overlap. Chosen."""
MAX_SPEED_M_S = 10.0
"""Largest median speed, m/s. Chosen."""
MAX_TURN_RATE_RAD_S = 8.0
"""Largest plausible turn rate, rad/s. Chosen."""
MAX_STEP_RAD = math.pi
"""Largest plausible turn between rows, rad. Chosen."""
MIN_TURN_RAD = 0.01
"""Smaller steps are no turn, rad. Chosen."""
FULL_TURNS_RAD = 7.0
"""A wrapped heading in radians is below this."""
FULL_TURN_DEG = 360.5
"""A wrapped heading in degrees is below this."""
WRAP_DEG = 300.0
"""A larger step is a wrap in degrees."""
DEGREES = 30.0, 110.0
"""Range of the ratio between numbers of degrees and of radians. Chosen around 57.3."""


def check_clock(time_s: Array) -> None:
    """Check the times in the order of the file.

    Raises:
        LogError: the clock was set back, or its resolution is a second or coarser.
    """
    if len(time_s) < MIN_ROWS:
        return
    repeated = 1 - len(np.unique(time_s)) / len(time_s)
    if repeated > MAX_REPEATED:
        raise LogError(
            f"time_s: {100 * repeated:.0f} % of the rows repeat a time: it is rounded, "
            "or logs were joined; log fractions of seconds"
        )
    for row in np.flatnonzero(np.diff(time_s) < -SET_BACK_S) + 1:
        before, following = time_s[:row], time_s[row : row + MIN_ROWS]
        beyond = np.flatnonzero(following >= before.max())
        behind = following[: beyond[0]] if len(beyond) else following
        overlap = (before >= behind[0]) & (before <= behind[-1])
        is_continued = len(behind) >= MIN_OVERLAP and (np.diff(behind) > 0).all()
        if is_continued and overlap.sum() >= MIN_OVERLAP:  # rows that are only late fill a gap
            raise LogError(
                f"time_s goes back by {time_s[row - 1] - time_s[row]:.6g} s after "
                f"{time_s[row - 1]:.6g} s: the clock was set, or logs were joined; cut it there, "
                "and log a monotonic clock"
            )


def check_units(time_s: Array, odometry: Array, gyro_rad_s: Array | None) -> None:
    """Check rows in order of time, with headings as recorded.

    Raises:
        LogError: one line with the probable unit.
    """
    if len(time_s) < MIN_ROWS:
        return
    with np.errstate(over="ignore", invalid="ignore"):
        dt_s = np.diff(time_s)
        _check_time(time_s, dt_s)
        _check_places(dt_s, odometry)
        _check_headings(dt_s, odometry[:, 2], gyro_rad_s)


def _check_time(time_s: Array, dt_s: Array) -> None:
    interval_s = float(np.median(dt_s))
    if interval_s >= MAX_INTERVAL_S:
        name, factor = next(
            ((name, factor) for most, name, factor in TIME_UNITS if interval_s < most),
            ("nanoseconds", "1e9"),
        )
        raise LogError(
            f"time_s: rows are {interval_s:.4g} s apart, and should be 0.05 to 1 s: "
            f"if these are {name}, divide by {factor}"
        )
    if interval_s < MIN_INTERVAL_S:
        raise LogError(
            f"time_s: rows are {interval_s:.4g} s apart, and should be 0.05 to 1 s: "
            "if these are days, multiply by 86400; if hours, by 3600"
        )
    leap = int(dt_s.argmax())
    if dt_s[leap] > MAX_LEAP_S:
        raise LogError(
            f"time_s leaps by {dt_s[leap]:.6g} s after {time_s[leap]:.6g} s: the clock was set "
            "while it was recorded; cut the log there, and log a monotonic clock"
        )


def _check_places(dt_s: Array, odometry: Array) -> None:
    steps_m = np.hypot(*np.diff(odometry[:, :2], axis=0).T)
    moves = (steps_m > 0) & (dt_s <= MAX_INTERVAL_S)
    if moves.sum() < MIN_ROWS:
        return
    speed_m_s = float(np.median(steps_m[moves] / dt_s[moves]))
    if speed_m_s > MAX_SPEED_M_S:
        raise LogError(
            f"odom_x_m, odom_y_m: the speed is {speed_m_s:.3g} m/s: if these are millimetres, "
            "divide by 1000; if centimetres, by 100"
        )


def _check_headings(dt_s: Array, yaw: Array, gyro_rad_s: Array | None) -> None:
    steps = np.diff(yaw)
    ratio = math.nan if gyro_rad_s is None else _against_gyro(dt_s, steps, gyro_rad_s)
    if DEGREES[0] < ratio < DEGREES[1] or _are_degrees(dt_s, yaw, steps):
        raise LogError(
            f"odom_yaw_rad: values up to {np.abs(yaw).max():.4g} change like degrees: "
            "multiply by 0.0174533"
        )
    if DEGREES[0] < 1 / (ratio or math.inf) < DEGREES[1]:
        raise LogError(
            f"gyro_z_rad_s: is {1 / ratio:.0f} times odom_yaw_rad's rate: if these are degrees "
            "per second, multiply by 0.0174533"
        )


def _are_degrees(dt_s: Array, yaw: Array, steps: Array) -> bool:
    """True for headings beyond a full turn in radians that turn implausibly fast."""
    if np.abs(yaw).max() < FULL_TURNS_RAD:
        return False
    turned = np.abs(steps)
    if np.abs(yaw).max() <= FULL_TURN_DEG and (turned > WRAP_DEG).any():
        return True
    turns = (turned > MIN_TURN_RAD) & (dt_s <= MAX_INTERVAL_S)
    if turns.sum() < MIN_ROWS:
        return False
    fast = np.quantile(turned[turns] / dt_s[turns], 0.75) > MAX_TURN_RATE_RAD_S
    return bool(fast or np.quantile(turned[turns], 0.8) > MAX_STEP_RAD)


def _against_gyro(dt_s: Array, steps: Array, gyro_rad_s: Array) -> float:
    """Ratio of the heading's turn to the gyro's; NaN if they are not correlated."""
    turned = (gyro_rad_s[1:] + gyro_rad_s[:-1]) / 2 * dt_s
    usable = np.isfinite(turned) & (dt_s <= MAX_INTERVAL_S) & (np.abs(steps) < WRAP_DEG / 2)
    steps, turned = steps[usable], turned[usable]
    if len(steps) < MIN_ROWS or min(np.abs(steps).sum(), np.abs(turned).sum()) < 0.5:
        return math.nan
    both = float(steps @ turned)
    correlation = both / math.sqrt(float(steps @ steps) * float(turned @ turned))
    return both / float(turned @ turned) if correlation > 0.5 else math.nan
